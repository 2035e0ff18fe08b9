//! `comparison.json`: depth models compared on data that their fits did not see.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::{DatasetEvaluation, FileError, read_json, write_json};

/// Models, best first.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// The dataset that the models were fitted to.
    pub train: String,
    /// The datasets that they were judged on; without any, frames of `train` that each fit left out.
    pub verify: Vec<String>,
    /// The models, best first by the dot error on data that they did not see; those that could not be fitted last.
    pub models: Vec<ModelComparison>,
    /// What the ranking says, in sentences.
    #[serde(default)]
    pub verdict: Vec<String>,
    /// Errors against the number of fitted frames.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub learning_curve: Vec<LearningPoint>,
    /// Subsets of D, with and without lens, and the four estimators.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub variants: Vec<ModelComparison>,
    /// D refitted to every dataset.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stability: Option<StabilityRecord>,
}

/// One model.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct ModelComparison {
    /// Its name, as given to `--models`.
    pub model: String,
    /// Lens model.
    pub lens: String,
    /// Estimator.
    pub estimator: String,
    /// Free parameters of camera, lens and depth model, without poses.
    pub parameters: usize,
    /// What of them the data rather than priors determine.
    pub effective_parameters: f64,
    /// Errors on the fitted frames.
    pub fit: Errors<Option<f64>>,
    /// Errors on data that the fit did not see: mean over the datasets, with 95 % intervals from resampled frames.
    pub held_out: Errors<Option<Interval>>,
    /// Held-out dot error minus that of the best model, from the same resampled frames.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub worse_than_best_mm: Option<Interval>,
    /// Whether that difference is real, with the number of models allowed for.
    #[serde(default)]
    pub really_worse: bool,
    /// Akaike's information criterion less that of the best.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub aic: Option<f64>,
    /// Schwarz' information criterion less that of the best.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bic: Option<f64>,
    /// Held-out depth pixels that the model cannot correct, share of all.
    #[serde(default)]
    pub not_correctable: f64,
    /// Every dataset, the fitted one first.
    pub per_dataset: Vec<DatasetEvaluation>,
    /// Why there is no fit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failed: Option<String>,
}

/// The three errors.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Errors<T> {
    /// Mean dot error, mm.
    pub dot_error_mm: T,
    /// Mean plane error, mm.
    pub plane_error_mm: T,
    /// Root mean square of the depth error, mm.
    pub depth_rms_mm: T,
}

/// A value and the interval that holds it with 95 % confidence.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    /// The value.
    pub mean: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// Errors of a model that was fitted to some of the frames.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct LearningPoint {
    /// The model.
    pub model: String,
    /// Frames in each fit.
    pub frames: usize,
    /// Fits, each to other frames.
    pub fits: usize,
    /// Those of them that failed.
    pub failed: usize,
    /// Why they failed: every reason once.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub reasons: Vec<String>,
    /// Mean errors over the fits on data that they did not see.
    pub held_out: Errors<Option<f64>>,
}

/// D refitted to every dataset, with K and lens of the training dataset.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct StabilityRecord {
    /// The estimates, dataset by dataset, estimator by estimator.
    pub estimates: Vec<StabilityEstimate>,
    /// Squared scatter of the joint estimates in units of their covariances.
    pub chi_squared: f64,
    /// Its degrees of freedom.
    pub degrees_of_freedom: usize,
    /// Probability of such a scatter if the camera were the same and the uncertainties right.
    pub p_value: f64,
    /// What the test says, and what datasets cannot determine.
    pub verdict: Vec<String>,
}

/// One estimate of D.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct StabilityEstimate {
    /// The dataset.
    pub dataset: String,
    /// The model: `projective` or a subset.
    pub model: String,
    /// The estimator.
    pub estimator: String,
    /// dx, dy, dz (1/mm), dw.
    pub d: [f64; 4],
    /// Half widths of 95 % intervals; only from the joint adjustment.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub half_width: Option<[f64; 4]>,
}

impl Comparison {
    /// Reads a comparison.
    ///
    /// # Errors
    /// [`FileError::Read`], or [`FileError::Json`] with file and field.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, FileError> {
        read_json(path)
    }

    /// Writes the comparison atomically.
    ///
    /// # Errors
    /// [`FileError::NotFinite`] with the field, [`FileError::Write`].
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), FileError> {
        write_json(path, self)
    }

    /// The entry of a model.
    pub fn model(&self, name: &str) -> Option<&ModelComparison> {
        self.models.iter().find(|m| m.model == name)
    }
}
