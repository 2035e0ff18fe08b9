//! The frames that are fitted: those that do not fit the model are excluded, and readmitted once effects explain them.

use depthcal_model::{ModelSpec, PieceSpec};
use tracing::info;

use super::augmented_model::AugmentedModel;
use super::bench::Bench;
use super::fitter::Fitter;
use crate::calibrate::{CalibrateError, CalibratedCamera, CameraOptions, calibrate_camera, sampled_under};
use crate::diagnose::bad_frames::{BadFrame, BadFrameReason, explain};
use crate::diagnose::frame_planes::{FramePlane, frame_planes, outlying};
use crate::observe::{CameraFrames, DetectedFrame};

/// The frames of a capture that are fitted, and those that are excluded.
#[derive(Clone)]
pub(super) struct Frames {
    /// The capture without the excluded frames.
    pub used: CameraFrames,
    /// Frames that are excluded, and why.
    pub bad: Vec<BadFrame>,
}

impl Frames {
    /// The frames without further ones.
    fn without(mut self, further: impl IntoIterator<Item = BadFrame>) -> Self {
        self.bad.extend(further);
        let used = without(&self.used, &self.bad);
        Self { used, bad: self.bad }
    }

    /// The frames without those that a fit dropped because their depth is another frame's.
    fn without_foreign(self, fit: &CalibratedCamera) -> Self {
        self.without(fit.foreign_depth.iter().map(|foreign| {
            let reason = BadFrameReason::Moved { offset_mm: foreign.rms_mm, rms_mm: foreign.rms_mm };
            BadFrame { name: foreign.name.clone(), reason }
        }))
    }
}

fn without(capture: &CameraFrames, bad: &[BadFrame]) -> CameraFrames {
    capture.subset(|_, f| bad.iter().all(|b| b.name != f.name))
}

/// A depth model of one parameter, the scale: it cannot bend towards frames whose depth is wrong, so that these stand out.
fn rigid_model() -> ModelSpec {
    ModelSpec::of(PieceSpec::new("projective").only("w"))
}

/// Fits the declared model without frames whose depth is another frame's. Where depth that belongs to other frames bends it so
/// far that the fit cannot be trusted, frames that are outlying under the rigid model `projective:w` are excluded first.
///
/// # Errors
///
/// [`CalibrateError`] where the declared model cannot be fitted.
pub(super) fn fit_declared(fitter: &Fitter<'_>, frames: Frames) -> Result<(Frames, CalibratedCamera), CalibrateError> {
    let bench = fitter.on(&frames.used, 0);
    let (declared, thresholds) = (bench.declared(), bench.thresholds());
    let error = match bench.fit(declared) {
        Err(error) if error.is_untrusted_fit() => error,
        Err(error) => return Err(error),
        Ok(fit) => return Ok((frames.clone().without_foreign(&fit), fit)),
    };
    let rigid = CameraOptions { model: rigid_model(), effects: Vec::new(), ..declared.clone() };
    let Ok(fit) = bench.fit(&rigid) else { return Err(error) };
    let planes = frame_planes(&fit);
    let bad = outlying(&planes, thresholds.gross_plane_mm, thresholds);
    if bad.is_empty() {
        return Err(error);
    }
    info!("{error}: tried again without {} frames", bad.len());
    let frames = frames.clone().without_foreign(&fit).without(explain(&fit, &bad, thresholds));
    let fit = fitter.on(&frames.used, 0).fit(declared)?;
    Ok((frames.without_foreign(&fit), fit))
}

/// Excludes frames whose plane is outlying and larger than `least_mm`, and fits the model again, until there are none. `None`
/// where there are none at once.
///
/// # Errors
///
/// [`CalibrateError`] where the model cannot be fitted without them.
pub(super) fn without_outlying(
    fitter: &Fitter<'_>,
    round: usize,
    model: &AugmentedModel,
    (frames, fit): (&Frames, &CalibratedCamera),
    least_mm: f64,
) -> Result<Option<(Frames, CalibratedCamera)>, CalibrateError> {
    let mut changed: Option<(Frames, CalibratedCamera)> = None;
    let bench = fitter.on(&frames.used, round);
    let (options, thresholds) = (model.options(bench.declared()), bench.thresholds());
    for _ in 0..thresholds.most_exclusion_rounds {
        bench.report("looking for bad frames", &options);
        let (frames, fit) = changed.as_ref().map_or((frames, fit), |(frames, fit)| (frames, fit));
        let planes = frame_planes(fit);
        let bad = outlying(&planes, least_mm, thresholds);
        if bad.is_empty() {
            break;
        }
        let frames = frames.clone().without(explain(fit, &bad, thresholds));
        let fit = fitter.on(&frames.used, round).fit(&options)?;
        changed = Some((frames, fit));
    }
    Ok(changed)
}

/// Explains the frames that are excluded for their depth again, all together, under a fit in which none of them takes part.
pub(super) fn explained_again(fitter: &Fitter<'_>, fit: &CalibratedCamera, mut frames: Frames) -> Frames {
    let is_for_depth =
        |b: &BadFrame| matches!(b.reason, BadFrameReason::Moved { .. } | BadFrameReason::DepthExchanged { .. });
    let excluded = fitter.whole.subset(|_, f| frames.bad.iter().any(|b| b.name == f.name && is_for_depth(b)));
    if excluded.frames.is_empty() {
        return frames;
    }
    let bench = fitter.on(&fitter.whole, 0);
    // Frames without a pose or samples under this fit keep the reason that they have.
    let Ok(under) = sampled_under(fit, &excluded, bench.declared()) else { return frames };
    let planes = frame_planes(&under);
    let all: Vec<&FramePlane> = planes.iter().collect();
    for explained in explain(&under, &all, bench.thresholds()) {
        if let Some(bad) = frames.bad.iter_mut().find(|b| b.name == explained.name) {
            *bad = explained;
        }
    }
    frames
}

/// The frames with those excluded ones that a model explains: their deviation was a missing effect. `None` where there are none.
///
/// # Errors
///
/// [`CalibrateError`] where the model cannot be fitted to all frames.
pub(super) fn readmitted(
    fitter: &Fitter<'_>,
    model: &AugmentedModel,
    frames: &Frames,
) -> Result<Option<Frames>, CalibrateError> {
    let bench = fitter.on(&frames.used, 0);
    let (whole, bad) = (&fitter.whole, &frames.bad);
    let is_excluded = |f: &DetectedFrame| bad.iter().any(|b| b.name == f.name);
    if !whole.frames.iter().any(is_excluded) {
        return Ok(None);
    }
    let all = CameraFrames { dropped: frames.used.dropped.clone(), ..whole.clone() };
    let planes = frame_planes(&calibrate_camera(&all, &model.options(bench.declared()))?);
    let still = outlying(&planes, 0.0, bench.thresholds());
    let fits = |b: &&BadFrame| {
        planes.iter().any(|p| p.name == b.name && p.p_value.is_finite()) && !still.iter().any(|p| p.name == b.name)
    };
    if !bad.iter().any(|b| fits(&b)) {
        return Ok(None);
    }
    let bad: Vec<BadFrame> = bad.iter().filter(|b| !fits(b)).cloned().collect();
    Ok(Some(Frames { used: without(whole, &bad), bad }))
}

#[cfg(test)]
mod tests {
    use depthcal_simulate::{CameraTruth, Kind, PointOptions, Simulation};

    use super::*;
    use crate::diagnose::options::CameraDiagnoseOptions;
    use crate::observe::MeasuredDepth;
    use crate::simulated;

    /// The depth of the two nearest boards is exchanged with that of the two farthest.
    #[test]
    fn frames_that_bend_the_declared_model_until_it_folds_are_excluded() {
        for seed in 0..6 {
            let simulation = Simulation::new(CameraTruth::published(1).unwrap(), Kind::General(1), &[], 1100 + seed);
            let mut capture = simulated::capture(&simulation.observe_points(&PointOptions::default()).unwrap());
            let mean = |f: &DetectedFrame| match &f.depth {
                MeasuredDepth::Pixels(pixels) => pixels.iter().map(|p| p.depth_mm).sum::<f64>() / pixels.len() as f64,
                _ => f64::NAN,
            };
            capture.frames.sort_by(|a, b| mean(a).total_cmp(&mean(b)));
            let last = capture.frames.len() - 1;
            for i in 0..2 {
                let near = std::mem::take(&mut capture.frames[i].depth);
                capture.frames[i].depth = std::mem::replace(&mut capture.frames[last - i].depth, near);
            }
            let exchanged = [0, 1, last - 1, last].map(|i| capture.frames[i].name.clone());
            let options = CameraDiagnoseOptions::default();
            // Least squares of all frames fold in some of these captures.
            assert!(
                calibrate_camera(&capture, &options.calibrate).is_ok_and(|fit| !fit.foreign_depth.is_empty()),
                "seed {seed}"
            );
            let fitter = Fitter::new(capture.clone(), None, &options);
            let (frames, fit) = fit_declared(&fitter, Frames { used: capture, bad: Vec::new() }).unwrap();
            let (model, gross) = (AugmentedModel::default(), options.thresholds.gross_plane_mm);
            let further = without_outlying(&fitter, 0, &model, (&frames, &fit), gross).unwrap();
            let bad_frames = further.map_or(frames, |(frames, _)| frames).bad;
            assert!(exchanged.iter().all(|n| bad_frames.iter().any(|b| b.name == *n)), "seed {seed}: {bad_frames:?}");
            assert_eq!(bad_frames.len(), exchanged.len(), "seed {seed}: {bad_frames:?}");
        }
    }
}
