//! Exclusion of frames that do not fit the model, and their readmission once effects explain them.

use depthcal_model::{ModelSpec, PieceSpec};
use tracing::info;

use super::augmented_model::AugmentedModel;
use super::bad_frames::{BadFrame, BadFrameReason, explain};
use super::frame_planes::{FramePlane, frame_planes, outlying};
use crate::calibrate::{CalibrateError, CalibrateOptions, Calibrated, calibrate, sampled_under};
use crate::observe::{Capture, DetectedFrame};

/// A depth model of one parameter, the scale: it cannot bend towards frames whose depth is wrong, so that these stand out.
fn rigid_model() -> ModelSpec {
    ModelSpec::of(PieceSpec::new("projective").only("w"))
}

impl AugmentedModel<'_> {
    /// Fits the declared model without frames whose depth is another frame's. Where depth that belongs to other frames bends it so far that the fit cannot be trusted, frames
    /// that are outlying under the rigid model `projective:w` are excluded first.
    pub fn fit_declared(&mut self, bad_frames: &mut Vec<BadFrame>) -> Result<Calibrated, CalibrateError> {
        let declared = self.declared();
        let error = match self.fit(declared) {
            Err(error) if error.is_untrusted_fit() => error,
            Err(error) => return Err(error),
            Ok(fit) => {
                self.exclude_foreign(&fit, bad_frames);
                return Ok(fit);
            }
        };
        let rigid = CalibrateOptions { model: rigid_model(), effects: Vec::new(), ..declared.clone() };
        let Ok(fit) = self.fit(&rigid) else { return Err(error) };
        let planes = frame_planes(&fit);
        let bad = outlying(&planes, self.thresholds().gross_plane_mm, self.thresholds());
        if bad.is_empty() {
            return Err(error);
        }
        info!("{error}: tried again without {} frames", bad.len());
        self.exclude_foreign(&fit, bad_frames);
        self.exclude(&fit, &bad, bad_frames);
        let fit = self.fit(declared)?;
        self.exclude_foreign(&fit, bad_frames);
        Ok(fit)
    }

    /// Excludes the frames that a fit dropped because their depth is another frame's.
    fn exclude_foreign(&mut self, fit: &Calibrated, bad_frames: &mut Vec<BadFrame>) {
        for foreign in &fit.foreign_depth {
            let reason = BadFrameReason::Moved { offset_mm: foreign.rms_mm, rms_mm: foreign.rms_mm };
            bad_frames.push(BadFrame { name: foreign.name.clone(), reason });
        }
        self.capture = without(&self.capture, bad_frames);
    }

    /// Explains the frames that are excluded for their depth again, all together, under a fit in which none of them takes part.
    pub fn explain_exclusions(&self, whole: &Capture, fit: &Calibrated, bad_frames: &mut [BadFrame]) {
        let is_for_depth =
            |b: &BadFrame| matches!(b.reason, BadFrameReason::Moved { .. } | BadFrameReason::DepthExchanged { .. });
        let excluded = whole.subset(|_, f| bad_frames.iter().any(|b| b.name == f.name && is_for_depth(b)));
        if excluded.frames.is_empty() {
            return;
        }
        // Frames without a pose or samples under this fit keep the reason that they have.
        let Ok(under) = sampled_under(fit, &excluded, self.declared()) else { return };
        let planes = frame_planes(&under);
        let all: Vec<&FramePlane> = planes.iter().collect();
        for explained in explain(&under, &all, self.thresholds()) {
            if let Some(bad) = bad_frames.iter_mut().find(|b| b.name == explained.name) {
                *bad = explained;
            }
        }
    }

    fn exclude(&mut self, fit: &Calibrated, bad: &[&FramePlane], bad_frames: &mut Vec<BadFrame>) {
        bad_frames.extend(explain(fit, bad, self.thresholds()));
        self.capture = without(&self.capture, bad_frames);
    }

    /// Excludes frames whose plane is outlying and larger than `least_mm`, and fits the present model again, until there are
    /// none. Returns whether there were any.
    pub fn exclude_bad_frames(
        &mut self,
        fit: &mut Calibrated,
        bad_frames: &mut Vec<BadFrame>,
        least_mm: f64,
    ) -> Result<bool, CalibrateError> {
        let before = bad_frames.len();
        for _ in 0..self.thresholds().most_exclusion_rounds {
            self.report("looking for bad frames", &self.present());
            let planes = frame_planes(fit);
            let bad = outlying(&planes, least_mm, self.thresholds());
            if bad.is_empty() {
                break;
            }
            self.exclude(fit, &bad, bad_frames);
            *fit = self.fit(&self.present())?;
        }
        Ok(bad_frames.len() > before)
    }

    /// Readmits excluded frames of `whole` that the present model explains: their deviation was a missing effect. Returns
    /// whether there were any.
    pub fn readmit(&mut self, whole: &Capture, bad_frames: &mut Vec<BadFrame>) -> Result<bool, CalibrateError> {
        let excluded = |f: &DetectedFrame| bad_frames.iter().any(|b| b.name == f.name);
        if !whole.frames.iter().any(excluded) {
            return Ok(false);
        }
        let all = Capture { dropped: self.capture.dropped.clone(), ..whole.clone() };
        let planes = frame_planes(&calibrate(&all, &self.present())?);
        let still = outlying(&planes, 0.0, self.thresholds());
        let fits = |b: &BadFrame| {
            planes.iter().any(|p| p.name == b.name && p.p_value.is_finite()) && !still.iter().any(|p| p.name == b.name)
        };
        let returned: Vec<String> = bad_frames.iter().filter(|b| fits(b)).map(|b| b.name.clone()).collect();
        bad_frames.retain(|b| !returned.contains(&b.name));
        self.capture = without(whole, bad_frames);
        Ok(!returned.is_empty())
    }
}

fn without(capture: &Capture, bad_frames: &[BadFrame]) -> Capture {
    capture.subset(|_, f| bad_frames.iter().all(|b| b.name != f.name))
}

#[cfg(test)]
mod tests {
    use depthcal_simulate::{CameraTruth, Kind, PointOptions, Simulation};

    use super::super::options::DiagnoseOptions;
    use super::*;
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
            let options = DiagnoseOptions::default();
            // Least squares of all frames fold in some of these captures.
            assert!(
                calibrate(&capture, &options.calibrate).is_ok_and(|fit| !fit.foreign_depth.is_empty()),
                "seed {seed}"
            );
            let mut model = AugmentedModel::new(capture, None, &options);
            let mut bad_frames = Vec::new();
            let mut fit = model.fit_declared(&mut bad_frames).unwrap();
            model.exclude_bad_frames(&mut fit, &mut bad_frames, options.thresholds.gross_plane_mm).unwrap();
            assert!(exchanged.iter().all(|n| bad_frames.iter().any(|b| b.name == *n)), "seed {seed}: {bad_frames:?}");
            assert_eq!(bad_frames.len(), exchanged.len(), "seed {seed}: {bad_frames:?}");
        }
    }
}
