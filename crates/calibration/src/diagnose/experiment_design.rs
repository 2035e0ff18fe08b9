//! Experiment design: captures that would answer what these captures leave open. Frames that would distinguish effects, and
//! covariates that were not recorded.

use depthcal_model::{Context, Covariate, PieceSpec, Register, Role};
use nalgebra::{DVector, Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use tracing::info;

use super::candidate_blocks::{CandidateBlock, linearize};
use super::discovery::{Discovery, RUNNER_UP};
use super::observed_states::ObservedStates;
use super::step::Step;
use super::thresholds::Thresholds;
use crate::calibrate::Calibrated;
use crate::observe::board_region::BoardRegion;
use crate::observe::{DepthSample, DetectedFrame, MarkerObservation, PosedFrame, RawFrame, SampledFrame};

/// Depth samples per side of the board in a predicted frame.
const SAMPLES_PER_SIDE: usize = 20;
/// Distance of the farthest proposed frame over the largest depth that was captured.
const FARTHER: f64 = 1.3;
/// Angle by which the board of a proposed frame is tilted, degrees.
const TILT_DEG: f64 = 45.0;
/// Rise of the temperature over the highest one of the captures that a proposed frame may have, °C.
const WARMER_C: f64 = 10.0;

/// A capture that would answer an open question.
#[derive(Debug, Clone, PartialEq)]
pub enum CaptureProposal {
    /// A frame that would distinguish an effect from another one that these captures cannot distinguish from it.
    Distinguish {
        /// The effect that was added.
        effect: String,
        /// The other effect.
        rival: String,
        /// The best one of the frames that were tried.
        frame: ProposedFrame,
        /// Number of such frames with which the noncentrality is sufficient.
        frames: f64,
        /// Noncentrality of the effect given the other one (squared distance in standard deviations) with these captures.
        noncentrality: f64,
        /// Noncentrality with one frame more.
        noncentrality_with_frame: f64,
        /// Noncentrality that is sufficient: [`Thresholds::distinguishing_noncentrality`].
        sufficient_noncentrality: f64,
    },
    /// A covariate without which effects cannot show.
    Record {
        /// The covariate.
        covariate: Covariate,
        /// The effects.
        effects: Vec<String>,
    },
}

/// A view of the board that could be captured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProposedFrame {
    /// Depth of the board's middle, mm.
    pub distance_mm: f64,
    /// Place of the board in the image.
    pub place: ImagePlace,
    /// Tilt of the board.
    pub tilt: BoardTilt,
    /// Rise over the highest temperature of the captures, °C; `None` for their median temperature.
    pub warmer_c: Option<f64>,
}

/// Place of the board's middle in the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ImagePlace {
    /// The middle.
    Middle,
    /// The middle of the left edge.
    LeftEdge,
    /// The middle of the right edge.
    RightEdge,
    /// The middle of the upper edge.
    Top,
    /// The upper left corner.
    UpperLeft,
    /// The lower right corner.
    LowerRight,
}

impl ImagePlace {
    const ALL: [Self; 6] =
        [Self::Middle, Self::LeftEdge, Self::RightEdge, Self::Top, Self::UpperLeft, Self::LowerRight];

    /// Column and row as shares of the image's width and height.
    pub fn position(self) -> [f64; 2] {
        match self {
            Self::Middle => [0.5, 0.5],
            Self::LeftEdge => [0.2, 0.5],
            Self::RightEdge => [0.8, 0.5],
            Self::Top => [0.5, 0.25],
            Self::UpperLeft => [0.2, 0.2],
            Self::LowerRight => [0.8, 0.8],
        }
    }
}

/// Tilt of the board against the image plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum BoardTilt {
    /// Parallel to the image plane.
    Parallel,
    /// Turned about the vertical axis by this angle, degrees.
    AboutVertical(f64),
    /// Turned about the horizontal axis by this angle, degrees.
    AboutHorizontal(f64),
}

impl BoardTilt {
    const ALL: [Self; 3] = [Self::Parallel, Self::AboutVertical(TILT_DEG), Self::AboutHorizontal(TILT_DEG)];

    /// Angles about the horizontal (x) and the vertical (y) axis, degrees.
    pub fn angles_deg(self) -> [f64; 2] {
        match self {
            Self::Parallel => [0.0, 0.0],
            Self::AboutVertical(angle) => [0.0, angle],
            Self::AboutHorizontal(angle) => [angle, 0.0],
        }
    }
}

/// For every added effect and every effect that the captures cannot distinguish from it: the frame that would distinguish them
/// best.
pub fn distinguishing_frames(
    fit: &Calibrated,
    register: &Register,
    steps: &[Step],
    thresholds: &Thresholds,
) -> Vec<CaptureProposal> {
    let mut proposals = Vec::new();
    for step in steps.iter().filter(|s| !s.indistinguishable.is_empty()) {
        for rival in &step.indistinguishable {
            proposals.extend(distinguish(fit, register, step, rival, thresholds));
        }
    }
    proposals
}

/// For a formula: the frame that would distinguish it best from each effect of the catalogue that it resembles, and from the best
/// formula of other covariates, which the proposal names by its text. `register` has the formula.
pub fn frames_against_rivals(
    fit: &Calibrated,
    mut register: Register,
    step: &Step,
    formula: &Discovery,
    thresholds: &Thresholds,
) -> Vec<CaptureProposal> {
    let of_catalogue = formula.resembles.iter().map(|name| (name.clone(), name.clone()));
    let mut rivals: Vec<(String, String)> = of_catalogue.collect();
    if let Some(lost) = formula.runners_up.first() {
        match lost.effect.register(&mut register) {
            Ok(()) => rivals.push((RUNNER_UP.to_owned(), lost.effect.text())),
            Err(error) => info!("{error}"),
        }
    }
    let proposal = |(name, told): (String, String)| match distinguish(fit, &register, step, &name, thresholds)? {
        CaptureProposal::Distinguish { effect, frame, frames, noncentrality, noncentrality_with_frame, .. } => {
            Some(CaptureProposal::Distinguish {
                effect,
                rival: told,
                frame,
                frames,
                noncentrality,
                noncentrality_with_frame,
                sufficient_noncentrality: thresholds.distinguishing_noncentrality,
            })
        }
        other @ CaptureProposal::Record { .. } => Some(other),
    };
    rivals.into_iter().filter_map(proposal).collect()
}

fn distinguish(
    fit: &Calibrated,
    register: &Register,
    step: &Step,
    rival: &str,
    thresholds: &Thresholds,
) -> Option<CaptureProposal> {
    let name = step.effects.first()?;
    let fitted = fit.camera.block(name)?;
    let without = Calibrated { camera: fit.camera.filtered(|b| b.name() != name), ..fit.clone() };
    let candidates: Vec<CandidateBlock> = [step.spec.clone(), PieceSpec::new(rival)]
        .into_iter()
        .filter_map(|spec| CandidateBlock::effect(register, spec))
        .collect();
    let nominal = candidates.first()?.block.theta.clone();
    let effect = DVector::from_iterator(nominal.len(), fitted.theta.iter().zip(&nominal).map(|(a, b)| a - b));
    let present = linearize(&without, &candidates).ok()?;
    let now = present.noncentrality(0, &effect, &[1]);
    let (frames, predicted): (Vec<ProposedFrame>, Vec<SampledFrame>) = possible_frames(fit).into_iter().unzip();
    let further = Calibrated { capture: fit.capture.with_frames(predicted), ..without };
    let further = linearize(&further, &candidates).ok()?;
    let (best, then) = (0..frames.len())
        .map(|i| (i, present.with_cluster(&further, i).noncentrality(0, &effect, &[1])))
        .max_by(|a, b| a.1.total_cmp(&b.1))?;
    let sufficient = thresholds.distinguishing_noncentrality;
    let number = ((sufficient - now) / (then - now).max(1e-9)).ceil().max(1.0);
    Some(CaptureProposal::Distinguish {
        effect: name.clone(),
        rival: rival.to_owned(),
        frame: frames[best],
        frames: number,
        noncentrality: now,
        noncentrality_with_frame: then,
        sufficient_noncentrality: sufficient,
    })
}

/// Frames over distances, places in the image, tilts and temperatures that show the whole board, with the observations that
/// the fitted camera predicts for them.
fn possible_frames(fit: &Calibrated) -> Vec<(ProposedFrame, SampledFrame)> {
    let states = ObservedStates::of(fit);
    let Some(depth) = states.range(|s, _| 1.0 / s[2]) else { return Vec::new() };
    let temperature = states.range(|_, c| c.temperature_c);
    let amplitude = states.range(|_, c| c.amplitude).map_or(f64::NAN, |r| r.middle);
    let time_s = states.range(|_, c| c.time_s).map_or(0.0, |r| r.middle);
    let mut conditions = vec![(None, temperature.map_or(f64::NAN, |t| t.middle))];
    conditions.extend(temperature.map(|t| (Some(WARMER_C), t.high + WARMER_C)));
    let (w, h) = (fit.camera.width as f64, fit.camera.height as f64);
    let mut list = Vec::new();
    for distance_mm in [depth.low, depth.middle, depth.high, FARTHER * depth.high] {
        for place in ImagePlace::ALL {
            let [u, v] = place.position();
            for tilt in BoardTilt::ALL {
                for (warmer_c, temperature_c) in &conditions {
                    let context = Context { amplitude, time_s, temperature_c: *temperature_c, ..Context::default() };
                    let pose = pose(fit, distance_mm, [u * w, v * h], tilt.angles_deg());
                    if let Some(frame) = pose.and_then(|p| predicted_frame(fit, &p, &context)) {
                        list.push((ProposedFrame { distance_mm, place, tilt, warmer_c: *warmer_c }, frame));
                    }
                }
            }
        }
    }
    list
}

/// The pose that shows the board's middle at a pixel and a depth, turned by angles (degrees) about x and y.
fn pose(fit: &Calibrated, depth_mm: f64, pixel: [f64; 2], turn_deg: [f64; 2]) -> Option<Isometry3<f64>> {
    let ray = fit.camera.ray(pixel, 1.0 / depth_mm).ok()?;
    let points = fit.capture.target.points();
    let n = points.len() as f64;
    let middle = points.iter().fold(Vector3::zeros(), |c, p| c + Vector3::new(p[0], p[1], 0.0) / n);
    let rotation = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), turn_deg[0].to_radians())
        * UnitQuaternion::from_axis_angle(&Vector3::y_axis(), turn_deg[1].to_radians());
    let point = Vector3::new(ray[0], ray[1], 1.0) * depth_mm;
    Some(Isometry3::from_parts(Translation3::from(point - rotation * middle), rotation))
}

/// Markers and depth samples that the fitted camera predicts for a pose; `None` where a marker leaves the image.
fn predicted_frame(fit: &Calibrated, pose: &Isometry3<f64>, context: &Context) -> Option<SampledFrame> {
    let (w, h) = (fit.camera.width as f64, fit.camera.height as f64);
    let inside = |p: &[f64; 2]| p[0] > 0.0 && p[1] > 0.0 && p[0] < w - 1.0 && p[1] < h - 1.0;
    let pixel_of =
        |p: [f64; 2]| fit.camera.project(&(pose * Point3::from(fit.camera.board_point(p))).coords).filter(inside);
    let target = &fit.capture.target;
    let mut markers = Vec::new();
    for (index, point) in target.points().into_iter().enumerate() {
        markers.push(MarkerObservation { index, pixel: pixel_of(point)?, std_px: 1.0 });
    }
    let hull = BoardRegion::new(target).hull().to_vec();
    let span = |i: usize| hull.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, u), p| (l.min(p[i]), u.max(p[i])));
    let (x, y) = (span(0), span(1));
    let coordinate =
        |range: (f64, f64), i: usize| range.0 + (range.1 - range.0) * (i as f64 + 0.5) / SAMPLES_PER_SIDE as f64;
    let mut samples = Vec::new();
    for i in 0..SAMPLES_PER_SIDE {
        for k in 0..SAMPLES_PER_SIDE {
            let board_seed = [coordinate(x, i), coordinate(y, k)];
            let Some(pixel) = pixel_of(board_seed) else { continue };
            let depth_mm = (pose * Point3::new(board_seed[0], board_seed[1], 0.0)).z;
            samples.push(DepthSample { context: Context { pixel, ..*context }, depth_mm, board_seed });
        }
    }
    let raw = RawFrame { name: "predicted".to_owned(), ..RawFrame::default() };
    let detected = DetectedFrame { raw, markers, wrong_markers: Vec::new() };
    Some(SampledFrame { posed: PosedFrame { detected, camera_from_board: *pose }, samples: samples.into() })
}

/// Covariates that the captures lack and that effects of the register, which the camera does not have, need to show.
pub fn missing_covariates(fit: &Calibrated, register: &Register, thresholds: &Thresholds) -> Vec<CaptureProposal> {
    let states = ObservedStates::of(fit);
    let least_span = |covariate: Covariate| match covariate {
        Covariate::Temperature => thresholds.informative_temperature_span_c,
        Covariate::Time => f64::MIN_POSITIVE,
        _ => 0.0,
    };
    let is_missing = |c: &Covariate| {
        c.is_recorded()
            && states.range(|state, context| c.value(state, context)).is_none_or(|r| r.span() < least_span(*c))
    };
    let lacking =
        register.names().filter(|name| fit.camera.block(name).is_none()).filter_map(|name| register.find(name));
    let lacking: Vec<_> = lacking.filter(|piece| piece.role() == Role::Effect).collect();
    let proposal = |covariate: &Covariate| {
        // An effect is named with the first covariate that it lacks.
        let effects = lacking.iter().filter(|p| p.needs().iter().find(|c| is_missing(c)) == Some(covariate));
        let effects: Vec<String> = effects.map(|piece| piece.name().to_owned()).collect();
        (!effects.is_empty()).then_some(CaptureProposal::Record { covariate: *covariate, effects })
    };
    Covariate::ALL.iter().filter(|c| is_missing(c)).filter_map(proposal).collect()
}
