//! Frames whose depth belongs to another pose, or whose board has another size: their depth contradicts what the images of most
//! frames say of it. A few of them bend the depth model of a least squares fit until all frames contradict it, so they are found
//! before it, by an estimator with a high breakdown point.
//!
//! Per frame, the projective depth model (Sjöholm 2017) with a square of inverse depth in addition, linear in its parameters, is
//! compared with measured depth at the board points that the image gives. The parameters are those of the least trimmed squares
//! over frames: the half of the frames that agrees best (FAST-LTS; Rousseeuw, Van Driessen 2006). Smaller deviations, such as
//! those of boards that moved between image and depth, are left to the examination of a fit.

use depthcal_statistics::upper_median;
use nalgebra::{Point3, SMatrix, SVector};
use rand::seq::index::sample;
use rand::{SeedableRng, rngs::StdRng};
use tracing::warn;

use crate::observe::{CameraFrames, DroppedFrame, SampledFrame};

/// Fewer frames than this say nothing about one of them.
const FEWEST_FRAMES: usize = 6;
/// Fewer samples determine nothing; their frame is judged by the others.
const FEWEST_SAMPLES: usize = 12;
/// A frame is foreign where it deviates by this many times the median frame …
const RATIO: f64 = 6.0;
/// … and by this share of its distance: more than a warming camera drifts, or than systematic errors differ between frames.
const LEAST_SHARE: f64 = 0.04;
/// Frames that determine the parameters of a trial, and the number of trials.
const FRAMES_OF_TRIAL: usize = 4;
const TRIALS: usize = 500;
/// Steps of concentration of every trial, and of the best.
const STEPS: [usize; 2] = [2, 20];
/// Typical parameters, in units in which depth has the relative error 1: a ridge where frames do not determine them.
const TYPICAL: f64 = 0.3;
/// Relative error of depth against which the ridge is weighed.
const RELATIVE_ERROR: f64 = 3e-3;

/// dx, dy, dz, dw, and a coefficient of the square of inverse depth.
type Parameters = SVector<f64, 5>;

/// A frame whose depth contradicts what the images of most frames say of it.
#[derive(Debug, Clone, PartialEq)]
pub struct ForeignDepth {
    /// Its name.
    pub name: String,
    /// Root mean square deviation of its depth from the board that its image shows, mm.
    pub rms_mm: f64,
}

/// Mean squares of the relative error of a frame's depth as a quadratic of the parameters, θᵀ A θ − 2 bᵀ θ + 1, with parameters
/// that are scaled by the median inverse depth.
struct OfFrame {
    frame: usize,
    a: SMatrix<f64, 5, 5>,
    b: Parameters,
}

impl OfFrame {
    fn of(frame: usize, sampled: &SampledFrame, scale: f64) -> Option<Self> {
        let count = sampled.samples.len();
        let (mut a, mut b) = (SMatrix::zeros(), SVector::zeros());
        for sample in sampled.samples.iter() {
            let [x, y] = sample.board_seed;
            let point_in_camera = sampled.camera_from_board * Point3::new(x, y, 0.0);
            let inverse = 1.0 / point_in_camera.z;
            let [x, y] = [point_in_camera.x * inverse, point_in_camera.y * inverse];
            // (dx x + dy y + dz + dw ρ + q ρ²) / ρ_m = 1
            let row =
                SVector::from([scale * x, scale * y, scale, inverse, inverse * inverse / scale]) * sample.depth_mm;
            a += row * row.transpose();
            b += row;
        }
        let mean = 1.0 / count as f64;
        (count > 0 && b.iter().all(|v| v.is_finite())).then(|| Self { frame, a: a * mean, b: b * mean })
    }

    /// Root mean square of the relative error under parameters.
    fn deviation(&self, theta: &Parameters) -> f64 {
        (theta.dot(&(self.a * theta)) - 2.0 * self.b.dot(theta) + 1.0).max(0.0).sqrt()
    }
}

/// The parameters that fit some frames best.
fn fitted<'a>(frames: impl Iterator<Item = &'a OfFrame>) -> Option<Parameters> {
    let ridge = (RELATIVE_ERROR / TYPICAL).powi(2);
    let nominal = SVector::from([0.0, 0.0, 0.0, 1.0, 0.0]);
    let (mut a, mut b) = (SMatrix::identity() * ridge, nominal * ridge);
    frames.for_each(|f| {
        a += f.a;
        b += f.b;
    });
    Some(a.cholesky()?.solve(&b))
}

/// Parameters after some steps of concentration, each of which fits the frames that deviate least, and the sum of their squares.
fn concentrated(frames: &[OfFrame], mut theta: Parameters, steps: usize) -> Option<(f64, Parameters)> {
    let half = frames.len() / 2 + 1;
    let mut last = f64::INFINITY;
    for _ in 0..=steps {
        let mut order: Vec<(f64, &OfFrame)> = frames.iter().map(|f| (f.deviation(&theta).powi(2), f)).collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0));
        order.truncate(half);
        let sum: f64 = order.iter().map(|(square, _)| square).sum();
        if sum >= last {
            break;
        }
        last = sum;
        theta = fitted(order.into_iter().map(|(_, f)| f))?;
    }
    Some((last, theta))
}

/// The parameters of the least trimmed squares.
fn trimmed(frames: &[OfFrame]) -> Option<Parameters> {
    let mut random = StdRng::seed_from_u64(29);
    let trial = |_| {
        let chosen = sample(&mut random, frames.len(), FRAMES_OF_TRIAL);
        concentrated(frames, fitted(chosen.iter().map(|i| &frames[i]))?, STEPS[0])
    };
    let all = fitted(frames.iter()).and_then(|theta| concentrated(frames, theta, STEPS[0]));
    let best = (0..TRIALS).filter_map(trial).chain(all).min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(concentrated(frames, best.1, STEPS[1])?.1)
}

fn is_foreign(deviation: f64, median: f64) -> bool {
    deviation > LEAST_SHARE && deviation > RATIO * median
}

/// The deviations of frames from their boards.
struct Deviations {
    of_frames: Vec<f64>,
    median: f64,
    /// The parameters under which they are.
    theta: Parameters,
}

/// The deviation of every frame, and its median, under the parameters that fit all frames that are not foreign: half of the
/// frames hardly reach the ends of the range, where the others may deviate by what the half does not determine.
fn deviations(frames: &[OfFrame]) -> Option<Deviations> {
    let mut theta = trimmed(frames)?;
    let mut fitted_frames: Vec<bool> = Vec::new();
    let mut last = None;
    for _ in 0..STEPS[1] {
        let all: Vec<f64> = frames.iter().map(|f| f.deviation(&theta)).collect();
        let median = upper_median(&mut all.clone())?;
        let fits: Vec<bool> = all.iter().map(|deviation| !is_foreign(*deviation, median)).collect();
        last = Some(Deviations { of_frames: all, median, theta });
        if fits == fitted_frames {
            break;
        }
        theta = fitted(frames.iter().zip(&fits).filter(|(_, fits)| **fits).map(|(f, _)| f))?;
        fitted_frames = fits;
    }
    last
}

/// Takes frames whose depth contradicts that of most frames out of a capture; they are among its dropped.
pub(super) fn drop_foreign_depth(capture: &mut CameraFrames<SampledFrame>) -> Vec<ForeignDepth> {
    let mut inverse: Vec<f64> =
        capture.frames.iter().map(|frame| 1.0 / frame.camera_from_board.translation.z).collect();
    let Some(scale) = upper_median(&mut inverse) else { return Vec::new() };
    let all = capture.frames.iter().enumerate().filter_map(|(i, frame)| OfFrame::of(i, frame, scale));
    // A few depth pixels of a frame are mostly no measurements of the board, and nothing of the frame contradicts them.
    let (frames, few): (Vec<OfFrame>, Vec<OfFrame>) =
        all.partition(|f| capture.frames[f.frame].samples.len() >= FEWEST_SAMPLES);
    if frames.len() < FEWEST_FRAMES {
        return Vec::new();
    }
    let Some(Deviations { of_frames, median, theta }) = deviations(&frames) else { return Vec::new() };
    let of_few: Vec<f64> = few.iter().map(|f| f.deviation(&theta)).collect();
    let mut foreign: Vec<ForeignDepth> = Vec::new();
    for (f, deviation) in frames.iter().chain(&few).zip(of_frames.iter().chain(&of_few)) {
        if is_foreign(*deviation, median) {
            let SampledFrame { posed, .. } = &capture.frames[f.frame];
            let (name, distance_mm) = (posed.name.clone(), posed.camera_from_board.translation.z);
            let reason = format!(
                "its depth is off by {:.1} % of the distance where the median frame's is by {:.2} %: depth of another frame, or another \
                 board",
                100.0 * deviation,
                100.0 * median
            );
            warn!("frame {name} is dropped: {reason}");
            capture.dropped.push(DroppedFrame { name: name.clone(), reason });
            foreign.push(ForeignDepth { name, rms_mm: deviation * distance_mm });
        }
    }
    capture.frames.retain(|frame| foreign.iter().all(|f| f.name != frame.name));
    foreign
}

#[cfg(all(test, feature = "simulate"))]
mod tests {
    use depthcal_simulate::{CameraTruth, Effect, Kind, PointOptions, Simulation};

    use crate::calibrate::{CameraOptions, calibrate_camera};
    use crate::observe::{CameraFrames, DetectedFrame, MeasuredDepth};
    use crate::simulated;

    fn capture(seed: u64, effects: &[Effect]) -> CameraFrames {
        let simulation = Simulation::new(CameraTruth::published(1).unwrap(), Kind::General(1), effects, 300 + seed);
        simulated::capture(&simulation.observe_points(&PointOptions::default()).unwrap())
    }

    fn distance(frame: &DetectedFrame) -> f64 {
        let pixels = frame.depth_pixels();
        pixels.iter().map(|p| p.depth_mm).sum::<f64>() / pixels.len() as f64
    }

    /// Of 40 % of the frames every one has the depth of another at a clearly different distance: exactly those are dropped, and
    /// the calibration is that of the others.
    #[test]
    fn depth_of_other_frames_is_dropped() {
        for seed in 0..4 {
            let clean = capture(seed, &[]);
            let count = 2 * clean.frames.len() / 5;
            let foreign: Vec<usize> = (0..count).map(|i| (i * clean.frames.len()) / count).collect();
            let mut spoiled = clean.clone();
            for (k, i) in foreign.iter().enumerate() {
                let from = foreign[(k + 1) % count];
                spoiled.frames[*i].raw.depth = clean.frames[from].depth.clone();
            }
            let clearly = |(k, i): (usize, &usize)| {
                let from = &clean.frames[foreign[(k + 1) % count]];
                (distance(from) / distance(&clean.frames[*i]) - 1.0).abs() > 0.05
            };
            let clear: Vec<&str> = foreign
                .iter()
                .enumerate()
                .filter(|(k, i)| clearly((*k, i)))
                .map(|(_, i)| clean.frames[*i].name.as_str())
                .collect();
            let fit = calibrate_camera(&spoiled, &CameraOptions::default()).unwrap();
            assert!(clear.len() > count / 2);
            for name in &clear {
                assert!(fit.foreign_depth.iter().any(|f| f.name == *name), "seed {seed}: {name} stays");
            }
            let is_foreign = |name: &str| foreign.iter().any(|i| clean.frames[*i].name == name);
            assert!(fit.foreign_depth.iter().all(|f| is_foreign(&f.name)), "seed {seed}: {:?}", fit.foreign_depth);
        }
    }

    /// Systematic errors are no reason to drop a frame: twenty times what they can be detected by, or frames that moved by
    /// centimetres.
    #[test]
    fn errors_of_the_camera_are_not_foreign() {
        for (name, size) in
            [("cyclic_depth", 20.0), ("temporal_drift", 20.0), ("quadratic_depth", 20.0), ("radial_range", 30.0)]
        {
            let fit =
                calibrate_camera(&capture(7, &[Effect::new(name, size).unwrap()]), &CameraOptions::default()).unwrap();
            assert!(fit.foreign_depth.is_empty(), "{name}: {:?}", fit.foreign_depth);
        }
    }

    #[test]
    fn frames_without_depth_are_kept() {
        let mut some = capture(9, &[]);
        some.frames[3].raw.depth = MeasuredDepth::None;
        let fit = calibrate_camera(&some, &CameraOptions::default()).unwrap();
        assert_eq!((fit.capture.frames.len(), fit.foreign_depth.len()), (some.frames.len(), 0));
    }
}
