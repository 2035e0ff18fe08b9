//! A dataset fitted and judged.

use depthcal_io::DatasetEvaluation;
use depthcal_model::ModelSpec;

use super::error::TaskError;
use super::model_request::ModelRequest;
use crate::calibrate::{CalibrateError, CalibrateOptions, Calibrated, Estimator, calibrate};
use crate::judge::cross_validation::{cross_validate, split};
use crate::judge::evaluate::{Evaluated, evaluate};
use crate::judge::parts::Parts;
use crate::load::Loaded;
use crate::observe::Capture;

/// Every `every`-th frame, beginning with number `first` (from 0).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HoldOut {
    /// Period in frames, at least 2.
    pub every: usize,
    /// The first held-out frame, below `every`.
    pub first: usize,
}

/// What is fitted to a dataset, and how it is judged.
#[derive(Debug, Clone)]
pub struct FitRequest {
    /// The model.
    pub model: ModelRequest,
    /// How the depth model is estimated.
    pub estimator: Estimator,
    /// Frames that are not fitted but evaluated.
    pub hold_out: Option<HoldOut>,
    /// Parts of a cross-validation; not together with `hold_out`.
    pub cross_validate: Option<usize>,
    /// How frames are divided into these parts.
    pub parts: Parts,
}

/// A dataset divided into what is fitted and what is held out, with the options of the fit.
#[derive(Debug, Clone)]
pub struct PreparedFit {
    capture: Capture,
    held: Option<Capture>,
    options: CalibrateOptions,
    cross_validate: Option<(usize, Parts)>,
    /// Whether only camera and lens are fitted, because there is no depth and no depth model was asked for.
    pub images_only: bool,
}

/// A dataset, fitted.
#[derive(Debug, Clone)]
pub struct DatasetFit {
    /// The fit.
    pub result: Calibrated,
    /// Frames that were not fitted.
    pub held: Option<Capture>,
    options: CalibrateOptions,
    cross_validate: Option<(usize, Parts)>,
}

/// Errors of a fit.
#[derive(Debug, Clone)]
pub struct JudgedFit {
    /// On the frames that were fitted.
    pub fitted: Evaluated,
    /// On frames that were not, with how these were chosen, `held out` or `cross-validated`.
    pub held_out: Option<(&'static str, Evaluated)>,
}

impl FitRequest {
    /// Options of the fit: those of `base` with what is asked for.
    ///
    /// # Errors
    ///
    /// [`TaskError::Option`].
    pub fn options(&self, base: CalibrateOptions) -> Result<CalibrateOptions, TaskError> {
        Ok(CalibrateOptions { estimator: self.estimator, ..self.model.options(base)? })
    }

    /// Divides the frames of a dataset, and completes the options by what the dataset declares. Where there is no depth, and neither
    /// another model than `projective` nor effects are asked for, only camera and lens will be fitted.
    ///
    /// # Errors
    ///
    /// [`TaskError::Camera`] where the camera that the dataset declares is at fault.
    pub fn prepare(&self, loaded: &Loaded, options: CalibrateOptions) -> Result<PreparedFit, TaskError> {
        let (capture, held) = match self.hold_out {
            Some(HoldOut { every, first }) => {
                let (fitted, held) = split(&loaded.capture, every, first);
                (fitted, Some(held))
            }
            None => (loaded.capture.clone(), None),
        };
        let mut options = self.model.for_dataset(options, loaded)?;
        let images_only = !capture.has_depth() && self.model.model == "projective" && self.model.with.is_empty();
        if images_only {
            options.model = ModelSpec::none();
        }
        let cross_validate = self.cross_validate.map(|parts| (parts, self.parts));
        Ok(PreparedFit { capture, held, options, cross_validate, images_only })
    }
}

impl PreparedFit {
    /// Fits.
    ///
    /// # Errors
    ///
    /// [`CalibrateError`].
    pub fn fit(self) -> Result<DatasetFit, CalibrateError> {
        let Self { capture, held, mut options, cross_validate, .. } = self;
        let result = calibrate(&capture, &options)?;
        if let Some(comparison) = &result.lens_comparison {
            // Parts of a cross-validation are fitted with the lens of the whole.
            options.lens.clone_from(&comparison.chosen);
        }
        Ok(DatasetFit { result, held, options, cross_validate })
    }
}

impl DatasetFit {
    /// Errors on the fitted frames and, where frames are held out or cross-validated, on frames that were not fitted.
    ///
    /// # Errors
    ///
    /// [`CalibrateError`] where the model can be adjusted without none of the parts of a cross-validation.
    pub fn judge(&self) -> Result<JudgedFit, CalibrateError> {
        let Self { result, held, options, cross_validate: parts } = self;
        let stage = options.progress.stage("evaluation");
        let fitted = evaluate(&result.camera, &result.capture);
        drop(stage);
        let held_out = match (held, parts) {
            (Some(held), _) => {
                let _stage = options.progress.stage("evaluation");
                Some(("held out", evaluate(&result.camera, held)))
            }
            (None, Some((parts, how))) => Some(("cross-validated", cross_validate(result, *parts, *how, options)?)),
            (None, None) => None,
        };
        Ok(JudgedFit { fitted, held_out })
    }
}

impl JudgedFit {
    /// The errors for `evaluation.json`.
    pub fn records(&self) -> Vec<DatasetEvaluation> {
        let held_out = self.held_out.as_ref().map(|(how, evaluated)| {
            let mut record = evaluated.record();
            record.name = format!("{} ({how})", record.name);
            record
        });
        std::iter::once(self.fitted.record()).chain(held_out).collect()
    }
}
