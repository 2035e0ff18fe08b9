//! Depth that ends at a limit: a recorder that clips gives its largest value to everything beyond, which is no measurement.

use depthcal_statistics::upper_median;
use tracing::warn;

use super::depth_scale::depths;
use crate::observe::{CameraFrames, DroppedFrame, SampledFrame};
use crate::start::{FEWEST_FRAMES, StartError};

/// Share of a frame's samples at the limit above which the frame is left out.
const CLIPPED: f64 = 0.05;
/// Fewest such frames: one frame may be flat where it is farthest.
const FEWEST_CLIPPED: usize = 2;
/// How many times as many samples have a limit as have the value before it; of a rounded measurement they are alike.
const HEAPED: usize = 10;
/// Measured over true depth at a limit, against that of other depth: boards that are flat and farthest have the same.
const NEARER: f64 = 0.99;

/// Leaves out the frames that show the board at the largest depth of the capture where that is a limit.
///
/// # Errors
///
/// [`StartError::TooFewFrames`] of what is left.
pub(super) fn drop_clipped(capture: &mut CameraFrames<SampledFrame>) -> Result<(), StartError> {
    let Some(limit_mm) = limit_mm(capture) else { return Ok(()) };
    let share = |frame: &SampledFrame| {
        let at_limit = frame.samples.iter().filter(|sample| sample.depth_mm >= limit_mm).count();
        at_limit as f64 / frame.samples.len().max(1) as f64
    };
    let clipped: Vec<(String, f64)> =
        capture.frames.iter().map(|f| (f.name.clone(), share(f))).filter(|(_, share)| *share > CLIPPED).collect();
    if clipped.len() < FEWEST_CLIPPED {
        return Ok(());
    }
    let names: Vec<&str> = clipped.iter().map(|(name, _)| name.as_str()).collect();
    warn!(
        "{}: {} of {} frames are dropped: much of the board has the largest depth of the dataset there, {limit_mm:.0} mm, which is a limit \
         and no measurement: {}; record without the limit, or with the board nearer",
        capture.name,
        clipped.len(),
        capture.frames.len(),
        names.join(", ")
    );
    capture.frames.retain(|frame| !clipped.iter().any(|(name, _)| *name == frame.name));
    capture.dropped.extend(clipped.into_iter().map(|(name, share)| DroppedFrame {
        name,
        reason: format!("{:.0} % of its depth is at {limit_mm:.0} mm, a limit and no measurement", 100.0 * share),
    }));
    match capture.frames.len() {
        found if found < FEWEST_FRAMES => Err(StartError::TooFewFrames { found, needed: FEWEST_FRAMES }),
        _ => Ok(()),
    }
}

/// The largest depth of all samples, where far more have it than have the largest one below, and the boards that the images show
/// are farther away; `None` where it is no limit.
fn limit_mm(capture: &CameraFrames<SampledFrame>) -> Option<f64> {
    let pairs: Vec<[f64; 2]> = capture.frames.iter().flat_map(depths).collect();
    let measured = || pairs.iter().map(|[measured, _]| *measured);
    let largest = measured().max_by(f64::total_cmp)?;
    let before = measured().filter(|depth| *depth < largest).max_by(f64::total_cmp)?;
    let count = |value: f64| measured().filter(|depth| *depth == value).count();
    let ratio = |is_at_limit: bool| {
        let pairs = pairs.iter().filter(|[measured, _]| (*measured >= largest) == is_at_limit);
        upper_median(&mut pairs.map(|[measured, board]| measured / board).collect::<Vec<_>>())
    };
    let is_limit = count(largest) > HEAPED * count(before) && ratio(true)? < NEARER * ratio(false)?;
    is_limit.then_some(largest)
}

#[cfg(all(test, feature = "simulate"))]
mod tests {
    use depthcal_simulate::{CameraTruth, Kind, PointOptions, Simulation};

    use super::*;
    use crate::calibrate::{CalibrateError, CameraOptions, calibrate_camera};
    use crate::observe::MeasuredDepth;
    use crate::simulated;

    /// Depths in whole steps of `step_mm`, but no larger than `limit_mm`.
    fn recorded(step_mm: f64, limit_mm: f64) -> CameraFrames {
        let simulation = Simulation::new(CameraTruth::published(1).unwrap(), Kind::General(1), &[], 311);
        let mut capture = simulated::capture(&simulation.observe_points(&PointOptions::default()).unwrap());
        for frame in &mut capture.frames {
            if let MeasuredDepth::Pixels(pixels) = &mut frame.raw.depth {
                pixels.iter_mut().for_each(|p| p.depth_mm = ((p.depth_mm / step_mm).round() * step_mm).min(limit_mm));
            }
        }
        capture
    }

    /// Frames beyond a limit of 900 mm go, and the others have the errors that they have without it; a coarse step is no limit.
    #[test]
    fn frames_at_a_limit_are_dropped_and_those_of_coarse_steps_are_not() {
        let fit = |capture: &CameraFrames| calibrate_camera(capture, &CameraOptions::default()).unwrap();
        let clipped = recorded(0.1, 900.0);
        let is_clipped = |name: &str| {
            let frame = clipped.frames.iter().find(|frame| frame.name == name).unwrap();
            let pixels = frame.depth_pixels();
            pixels.iter().filter(|p| p.depth_mm == 900.0).count() * 10 > pixels.len()
        };
        let result = fit(&clipped);
        assert!(result.capture.frames.len() + 3 <= clipped.frames.len(), "{}", result.capture.frames.len());
        assert!(result.capture.frames.iter().all(|frame| !is_clipped(&frame.name)));
        let whole = fit(&recorded(0.1, f64::INFINITY));
        let rms = [&result, &whole].map(|fit| fit.depth_rms_mm.unwrap());
        assert!(rms[0] < 1.1 * rms[1], "{rms:?}");
        let beyond = clipped.subset(|_, frame| is_clipped(&frame.name));
        let error = calibrate_camera(&beyond, &CameraOptions::default()).map(|_| ()).unwrap_err();
        assert!(matches!(error, CalibrateError::Start(StartError::TooFewFrames { .. })), "{error}");
        let coarse = recorded(10.0, f64::INFINITY);
        assert_eq!(fit(&coarse).capture.frames.len(), coarse.frames.len());
    }
}
