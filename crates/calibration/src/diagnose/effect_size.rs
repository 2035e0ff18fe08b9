//! Sizes of effects: what they change in the observations, less what the other parameters of the model take up.

use std::ops::Range;

use depthcal_model::Block;
use depthcal_model::hook::HookKind;
use depthcal_statistics::Span;
use nalgebra::DMatrix;

use super::observed_states::ObservedStates;

/// Step for derivatives by a parameter, in its typical sizes.
const STEP: f64 = 1e-3;
/// Share of a change below which what is left of it is rounding.
const ROUNDING: f64 = 1e-9;

/// Sizes of effects over the observations of a fit, mm at the board: changes of depth for pieces that act on depth, of position
/// for all others. Of an effect of depth the part counts that the other free parameters of the depth model cannot take up; of
/// one of the lens, that which pinhole, lens and the poses of the frames cannot; of one of the board, that which neither its
/// motion nor its other effects can.
pub(super) struct EffectSizes<'a> {
    states: &'a ObservedStates,
    depth: TakenUp,
    lens: TakenUp,
    board: TakenUp,
}

/// Changes at one hook that other parameters take up, by least squares.
#[derive(Default)]
struct TakenUp {
    /// By the pose of every frame, for the rows of its markers.
    by_poses: Vec<(Range<usize>, Span)>,
    /// By parameters that all frames share, without what poses take up.
    shared: Span,
}

impl TakenUp {
    fn of(by_poses: Vec<(Range<usize>, Span)>, shared: Vec<Vec<f64>>) -> Self {
        let mut taken_up = Self { by_poses, shared: Span::default() };
        let shared: Vec<Vec<f64>> = shared.iter().map(|column| taken_up.left(column)).collect();
        taken_up.shared = Span::of(shared);
        taken_up
    }

    /// The part of a change that is left; rows without a value stay so.
    fn left(&self, change: &[f64]) -> Vec<f64> {
        let mut left: Vec<f64> = change.iter().map(|v| if v.is_finite() { *v } else { 0.0 }).collect();
        let rounding = ROUNDING * rms_length(left.iter().copied(), 1);
        for (rows, span) in &self.by_poses {
            span.take_off(&mut left[rows.clone()]);
        }
        self.shared.take_off(&mut left);
        if rms_length(left.iter().copied(), 1) < rounding {
            left.fill(0.0);
        }
        left.iter_mut().zip(change).filter(|(_, change)| !change.is_finite()).for_each(|(v, _)| *v = f64::NAN);
        left
    }
}

impl<'a> EffectSizes<'a> {
    /// Sizes of effects that the fit of `states` lacks, or of the one named `effect` that it has.
    pub fn new(states: &'a ObservedStates, effect: Option<&str>) -> Self {
        let columns = |hook: HookKind| -> Vec<Vec<f64>> {
            let others = states.model.iter().filter(|block| block.piece().is_some() && block.hook() == hook);
            others.filter(|block| Some(block.name()) != effect).flat_map(|block| derivatives(states, block)).collect()
        };
        let lens = columns(HookKind::Lens).into_iter().chain(by_pinhole(states)).collect();
        let board = columns(HookKind::Board).into_iter().chain(by_motion(&states.board)).collect();
        Self {
            states,
            depth: TakenUp::of(Vec::new(), columns(HookKind::Depth)),
            lens: TakenUp::of(by_poses(states), lens),
            board: TakenUp::of(Vec::new(), board),
        }
    }

    /// Root mean square over the observations of the change that a block makes at its parameters, against its nominal ones,
    /// without what others take up, mm; zero for the pinhole.
    pub fn rms_mm(&self, block: &Block) -> f64 {
        let nominal: Vec<f64> = block.parameters().iter().map(|p| p.nominal).collect();
        let change = change(self.states, block, [&nominal, &block.theta]);
        rms_length(self.left_mm(block.hook(), &change).into_iter(), parts(block.hook()))
    }

    /// Mean square of the change without what others take up, mm², as a quadratic form in small departures of a block's
    /// parameters from those it has, one row and column for each.
    pub fn square_mm2(&self, block: &Block) -> DMatrix<f64> {
        let column = |i: usize| self.left_mm(block.hook(), &derivative(self.states, block, i));
        let columns: Vec<Vec<f64>> = (0..block.theta.len()).map(column).collect();
        let scale = |i: usize| block.parameters()[i].scale;
        let element = |i: usize, k: usize| {
            let products = columns[i].iter().zip(&columns[k]).map(|(a, b)| a * b);
            mean_square(products, parts(block.hook())) / (scale(i) * scale(k))
        };
        DMatrix::from_fn(columns.len(), columns.len(), element)
    }

    /// The part of a change at a hook that is left, mm at the board.
    fn left_mm(&self, hook: HookKind, change: &[f64]) -> Vec<f64> {
        match hook {
            HookKind::Depth => self.depth.left(change),
            HookKind::Pixel => scaled(change, self.states.depth.iter().map(|s| 1.0 / (s[2] * self.states.focal_px))),
            HookKind::Lens => scaled(&self.lens.left(change), self.states.lens.iter().map(|s| 1.0 / s[2])),
            HookKind::Board => self.board.left(change),
            HookKind::Pose => change.to_vec(),
        }
    }
}

/// Pairs of numbers, each multiplied by one of `mm`.
fn scaled(pairs: &[f64], mm: impl Iterator<Item = f64>) -> Vec<f64> {
    pairs.chunks(2).zip(mm).flat_map(|(pair, mm)| pair.iter().map(move |v| v * mm)).collect()
}

/// Numbers per observation at a hook.
fn parts(hook: HookKind) -> usize {
    match hook {
        HookKind::Depth => 1,
        HookKind::Pixel | HookKind::Lens => 2,
        HookKind::Board | HookKind::Pose => 3,
    }
}

/// Change of the observations from one vector of a block's parameters to another, at its hook: depth in mm, one row for every
/// sample; pixels, two; rays, two for every marker; points of the board in mm, three. Empty for the pinhole.
fn change(states: &ObservedStates, block: &Block, [from, to]: [&[f64]; 2]) -> Vec<f64> {
    let Some(piece) = block.piece() else { return Vec::new() };
    let at_markers = vec![Default::default(); states.lens.len()];
    let pixels: Vec<f64>;
    let (inputs, contexts) = match block.hook() {
        HookKind::Depth => (states.depth.as_flattened(), &states.contexts),
        HookKind::Pixel => {
            pixels = states.contexts.iter().flat_map(|c| c.pixel).collect();
            (pixels.as_slice(), &states.contexts)
        }
        HookKind::Lens => (states.lens.as_flattened(), &at_markers),
        HookKind::Board | HookKind::Pose => (states.board.as_flattened(), &at_markers),
    };
    let run = |theta: &[f64]| {
        let mut out = vec![0.0; contexts.len() * parts(block.hook())];
        piece.evaluate(theta, inputs, contexts, &mut out);
        out
    };
    let difference: Vec<f64> = run(to).iter().zip(run(from)).map(|(to, from)| to - from).collect();
    match block.hook() {
        // dz = −z² dρ, exactly: 1/(ρ + dρ) − 1/ρ, without the rounding of a difference.
        HookKind::Depth => states.depth.iter().zip(difference).map(|(s, d)| -d / (s[2] * (s[2] + d))).collect(),
        _ => difference,
    }
}

/// The changes by every free parameter of a block, fields excepted: these have a prior.
fn derivatives(states: &ObservedStates, block: &Block) -> Vec<Vec<f64>> {
    if block.piece().is_none_or(|piece| piece.field().is_some()) {
        return Vec::new();
    }
    (0..block.theta.len()).filter(|i| block.free[*i]).map(|i| derivative(states, block, i)).collect()
}

/// The change by one parameter of a block, per its typical size.
fn derivative(states: &ObservedStates, block: &Block, parameter: usize) -> Vec<f64> {
    let mut moved = block.theta.clone();
    moved[parameter] += STEP * block.parameters()[parameter].scale;
    change(states, block, [&block.theta, &moved]).into_iter().map(|v| v / STEP).collect()
}

/// Changes of the markers' rays (a, b) by the free parameters of the pinhole: two focal lengths, principal point, skew.
fn by_pinhole(states: &ObservedStates) -> Vec<Vec<f64>> {
    let Some(pinhole) = states.model.iter().find(|block| block.piece().is_none()) else { return Vec::new() };
    let changes = |[a, b, ..]: [f64; 5]| [[a, 0.0], [0.0, b], [1.0, 0.0], [0.0, 1.0], [b, 0.0]];
    let column = |i: usize| states.lens.iter().flat_map(|state| changes(*state)[i]).collect();
    (0..pinhole.free.len()).filter(|i| pinhole.free[*i]).map(column).collect()
}

/// Changes of the markers' rays (a, b) by the pose of each frame: three translations at inverse depth ρ, three rotations.
fn by_poses(states: &ObservedStates) -> Vec<(Range<usize>, Span)> {
    let changes = |[a, b, rho, ..]: [f64; 5]| {
        [[rho, 0.0], [0.0, rho], [a * rho, b * rho], [a * b, 1.0 + b * b], [1.0 + a * a, a * b], [-b, a]]
    };
    let mut first = 0;
    let of_frame = |count: &usize| {
        let markers = &states.lens[first..first + count];
        let rows = 2 * first..2 * (first + count);
        first += count;
        let column = |i: usize| markers.iter().flat_map(|state| changes(*state)[i]).collect();
        (rows, Span::of((0..6).map(column)))
    };
    states.markers_of_frames.iter().map(of_frame).collect()
}

/// Changes of the points of the board by its motion: three translations, three rotations.
fn by_motion(points: &[[f64; 3]]) -> Vec<Vec<f64>> {
    let changes = |[x, y, _]: [f64; 3]| {
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, y], [0.0, 0.0, x], [-y, x, 0.0]]
    };
    let column = |i: usize| points.iter().flat_map(|point| changes(*point)[i]).collect();
    (0..6).map(column).collect()
}

/// Root mean square length of vectors with `parts` components each; components that are not finite are ignored.
fn rms_length(values: impl Iterator<Item = f64>, parts: usize) -> f64 {
    mean_square(values.map(|v| v * v), parts).sqrt()
}

/// Mean, over vectors with `parts` components each, of the sum of such squares or products; those that are not finite are
/// ignored.
fn mean_square(squares: impl Iterator<Item = f64>, parts: usize) -> f64 {
    let (sum, n) = squares.filter(|v| v.is_finite()).fold((0.0, 0_usize), |(s, n), v| (s + v, n + 1));
    sum * parts as f64 / n.max(1) as f64
}

#[cfg(all(test, feature = "simulate"))]
mod tests {
    use depthcal_model::Register;
    use depthcal_simulate::{CameraTruth, Kind, PointOptions, Simulation};
    use nalgebra::DVector;

    use super::*;
    use crate::calibrate::{CalibratedCamera, CameraOptions, calibrate_camera};
    use crate::simulated;

    fn fit() -> CalibratedCamera {
        let simulation = Simulation::new(CameraTruth::published(1).unwrap(), Kind::General(1), &[], 3);
        let capture = simulated::capture(&simulation.observe_points(&PointOptions::default()).unwrap());
        calibrate_camera(&capture, &CameraOptions::default()).unwrap()
    }

    /// A block whose first parameter departs from its nominal value.
    fn moved(spec: &str, by: f64) -> Block {
        let mut block = Register::builtin().block(spec, None).unwrap();
        block.theta[0] = block.parameters()[0].nominal + by;
        block
    }

    /// Against least squares by a singular value decomposition.
    #[test]
    fn what_the_depth_model_takes_up_does_not_count() {
        let fit = fit();
        let states = ObservedStates::of(&fit);
        let sizes = EffectSizes::new(&states, None);
        let of_depth = fit.camera.blocks().iter().filter(|b| b.piece().is_some() && b.hook() == HookKind::Depth);
        let columns: Vec<DVector<f64>> = of_depth
            .flat_map(|block| derivatives(&states, block))
            .map(|column| DVector::from_vec(column).normalize())
            .collect();
        let matrix = DMatrix::from_columns(&columns);
        for (block, shares) in [(moved("range_offset", 6.0), 0.0..0.5), (moved("cyclic_depth", 3.0), 0.8..1.0)] {
            let nominal: Vec<f64> = block.parameters().iter().map(|p| p.nominal).collect();
            let whole = DVector::from_vec(change(&states, &block, [&nominal, &block.theta]));
            let left = &whole - &matrix * matrix.clone().svd(true, true).solve(&whole, 1e-12).unwrap();
            let [whole, expected] = [whole, left].map(|values| rms_length(values.iter().copied(), 1));
            let size = sizes.rms_mm(&block);
            assert!((size / expected - 1.0).abs() < 1e-6, "{size} {expected}");
            let mut nominal_block = block.clone();
            nominal_block.theta.clone_from(&nominal);
            let departure = DVector::from_column_slice(&block.theta) - DVector::from_vec(nominal);
            let square = departure.dot(&(sizes.square_mm2(&nominal_block) * &departure));
            assert!((square.sqrt() / size - 1.0).abs() < 0.02, "{square} {size}");
            assert!(shares.contains(&(size / whole)), "{size} of {whole}");
        }
    }

    /// A change that others can make has no size at all.
    #[test]
    fn an_effect_that_others_take_up_has_no_size() {
        let fit = fit();
        let states = ObservedStates::of(&fit);
        let pieces = fit.camera.blocks().iter().filter(|b| b.piece().is_some() && b.hook() == HookKind::Lens);
        let column = pieces.flat_map(|block| derivatives(&states, block)).next().unwrap();
        let left = EffectSizes::new(&states, None).lens.left(&column);
        assert!(left.iter().all(|v| *v == 0.0), "{left:?}");
    }

    /// An effect that the model already has is not compensated by its own parameters: counted among the others, it would have no
    /// size.
    #[test]
    fn an_effect_of_the_model_does_not_compensate_itself() {
        let mut fit = fit();
        let wave = moved("cyclic_depth", 3.0);
        fit.camera = fit.camera.clone().with_block(wave.clone());
        let states = ObservedStates::of(&fit);
        // Nothing to first order.
        assert!(EffectSizes::new(&states, None).rms_mm(&wave) < 0.03);
        assert!(EffectSizes::new(&states, Some("cyclic_depth")).rms_mm(&wave) > 1.5);
    }

    /// Against least squares with the derivatives of the projection by pinhole, lens and poses, all by finite differences.
    #[test]
    fn poses_pinhole_and_lens_take_up_what_they_can_of_an_effect_of_the_lens() {
        let fit = fit();
        let states = ObservedStates::of(&fit);
        let tilt = moved("tilted_sensor", 0.02);
        let change = change(&states, &tilt, [&[0.0, 0.0], &tilt.theta]);
        let mut columns = by_pinhole(&states);
        for block in fit.camera.blocks().iter().filter(|b| b.piece().is_some() && b.hook() == HookKind::Lens) {
            columns.extend(derivatives(&states, block));
        }
        let mut first = 0;
        for count in &states.markers_of_frames {
            for axis in 0..6 {
                let mut column = vec![0.0; change.len()];
                for marker in first..first + count {
                    let [a, b, rho, ..] = states.lens[marker];
                    let point = nalgebra::Vector3::new(a, b, 1.0) / rho;
                    let mut unit = nalgebra::Vector3::zeros();
                    unit[axis % 3] = 1e-6;
                    let point_moved = if axis < 3 { point + unit } else { nalgebra::Rotation3::new(unit) * point };
                    column[2 * marker] = (point_moved.x / point_moved.z - a) * 1e6;
                    column[2 * marker + 1] = (point_moved.y / point_moved.z - b) * 1e6;
                }
                columns.push(column);
            }
            first += count;
        }
        // Columns of length 1, for their singular values to be alike.
        let columns: Vec<DVector<f64>> =
            columns.into_iter().map(DVector::from_vec).filter(|c| c.norm() > 0.0).map(|c| c.normalize()).collect();
        let (matrix, change) = (DMatrix::from_columns(&columns), DVector::from_vec(change));
        let solved = matrix.clone().svd(true, true).solve(&change, 1e-9).unwrap();
        let left = change - matrix * solved;
        let scale = states.lens.iter().flat_map(|state| [1.0 / state[2]; 2]);
        let expected = rms_length(left.iter().zip(scale).map(|(d, z)| d * z), 2);
        let size = EffectSizes::new(&states, None).rms_mm(&tilt);
        assert!((size / expected - 1.0).abs() < 1e-3, "{size} {expected}");
    }

    /// The size of a bend is its departure from the plane that fits it best.
    #[test]
    fn a_bent_board_has_its_size_without_the_motion_of_the_board() {
        let fit = fit();
        let states = ObservedStates::of(&fit);
        let mut bow = Register::builtin().for_board(&fit.capture.target).block("board_bow", None).unwrap();
        bow.theta[0] += 2.0;
        let nominal: Vec<f64> = bow.parameters().iter().map(|p| p.nominal).collect();
        let heights: Vec<f64> = change(&states, &bow, [&nominal, &bow.theta]).chunks_exact(3).map(|c| c[2]).collect();
        let plane = DMatrix::from_fn(heights.len(), 3, |row, i| [1.0, states.board[row][0], states.board[row][1]][i]);
        let heights = DVector::from_vec(heights);
        let left = &heights - &plane * plane.clone().svd(true, true).solve(&heights, 1e-12).unwrap();
        let expected = (left.norm_squared() / left.len() as f64).sqrt();
        let size = EffectSizes::new(&states, None).rms_mm(&bow);
        assert!((size / expected - 1.0).abs() < 0.02 && expected > 0.1, "{size} {expected}");
    }
}
