//! `comparison.json`: depth models compared on held-out data.

use depthcal_model::ModelSpec;
use serde::{Deserialize, Serialize};

use super::evaluation::DatasetEvaluation;
use super::interval::Interval;
use super::result_file::result_file;
use crate::file::{read_json, write_json};

/// Depth models compared on held-out data.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Comparison {
    /// The dataset that the models were fitted to.
    pub train: String,
    /// The datasets on which they were evaluated; when there is none, they were evaluated on frames of `train` left out
    /// of each fit.
    pub verify: Vec<String>,
    /// The models in ascending order of the held-out dot error; those that could not be fitted come last.
    pub models: Vec<ModelComparison>,
    /// The conclusions from the ranking, in sentences.
    #[serde(default)]
    pub verdict: Vec<String>,
    /// Errors against the number of fitted frames.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub learning_curve: Vec<LearningPoint>,
    /// Fits of the subsets of D, with and without lens, and of the four estimators.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub variants: Vec<ModelComparison>,
    /// D refitted to every dataset.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stability: Option<StabilityRecord>,
}

result_file!(Comparison, "comparison.json", read_json, write_json);

/// The errors of one model.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct ModelComparison {
    /// The depth model, as given to `--models`.
    #[schemars(with = "String")]
    pub model: ModelSpec,
    /// Lens model.
    pub lens: String,
    /// Estimator.
    pub estimator: String,
    /// Number of free parameters of camera, lens and depth model, poses excluded.
    pub parameters: usize,
    /// Number of parameters determined by the data rather than by priors.
    pub effective_parameters: f64,
    /// Errors on the fitted frames.
    pub fit: Errors<Option<f64>>,
    /// Errors on held-out data: mean over the datasets, with 95 % intervals from resampled frames.
    pub held_out: Errors<Option<Interval>>,
    /// Held-out dot error minus that of the best model, with its interval over the same resampled frames, mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub worse_than_best_mm: Option<Interval>,
    /// Whether that difference is significant, corrected for the number of models.
    #[serde(default)]
    pub really_worse: bool,
    /// Akaike's information criterion minus that of the best model.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub aic: Option<f64>,
    /// Schwarz' information criterion minus that of the best model.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bic: Option<f64>,
    /// Share of the held-out depth pixels that the model cannot correct.
    #[serde(default)]
    pub not_correctable: f64,
    /// Errors on every dataset, the fitted one first.
    pub per_dataset: Vec<DatasetEvaluation>,
    /// The error of the fit where it failed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failed: Option<String>,
}

/// The model to use, of models with the best first: the one with the fewest parameters of those that are not really worse than
/// the best. Effective numbers within one parameter of the least count as equal. `None` where no model could be fitted.
pub fn recommended(models: &[ModelComparison]) -> Option<&ModelComparison> {
    models.first().filter(|best| best.failed.is_none())?;
    let equal = || models.iter().filter(|m| m.failed.is_none() && !m.really_worse);
    let least = equal().map(|m| m.effective_parameters).fold(f64::INFINITY, f64::min);
    equal().filter(|m| m.effective_parameters < least + 1.0).min_by_key(|m| m.parameters)
}

impl ModelComparison {
    /// Share of the held-out board pixels that are no measurements of the board and are in none of the errors: mean over the
    /// datasets, which count alike as in the errors. `None` without depth.
    pub fn left_out_share(&self) -> Option<f64> {
        let shares: Vec<f64> = self.per_dataset.iter().skip(1).filter_map(|d| d.outliers.map(|o| o.share)).collect();
        (!shares.is_empty()).then(|| shares.iter().sum::<f64>() / shares.len() as f64)
    }
}

/// The three errors of depth.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Errors<T> {
    /// Mean dot error, mm.
    pub dot_error_mm: T,
    /// Mean plane error, mm.
    pub plane_error_mm: T,
    /// Root mean square of the depth error, mm.
    pub depth_rms_mm: T,
}

/// Errors of a model fitted to subsets of the frames.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct LearningPoint {
    /// The model.
    #[schemars(with = "String")]
    pub model: ModelSpec,
    /// Frames in each fit.
    pub frames: usize,
    /// Number of fits, each to another subset.
    pub fits: usize,
    /// Number of fits that failed.
    pub failed: usize,
    /// Errors of the failed fits, each once.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub reasons: Vec<String>,
    /// Errors on held-out data, averaged over the fits.
    pub held_out: Errors<Option<f64>>,
}

/// D refitted to every dataset, with K and lens from the training dataset.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct StabilityRecord {
    /// The estimates, dataset by dataset, estimator by estimator.
    pub estimates: Vec<StabilityEstimate>,
    /// χ² of the joint estimates about their weighted mean, with their covariances.
    pub chi_squared: f64,
    /// Its degrees of freedom.
    pub degrees_of_freedom: usize,
    /// Probability of so large a χ² if all datasets share one D and the covariances are right.
    pub p_value: f64,
    /// The conclusion of the test, and the parameters that single datasets do not determine, in sentences.
    pub verdict: Vec<String>,
}

/// One estimate of D.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct StabilityEstimate {
    /// The dataset.
    pub dataset: String,
    /// The model: `projective` or a subset.
    pub model: String,
    /// The estimator.
    pub estimator: String,
    /// dx, dy, dz (1/mm), dw.
    pub d: [f64; 4],
    /// Half widths of the 95 % confidence intervals; only the joint adjustment gives them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub half_width: Option<[f64; 4]>,
}

impl Comparison {
    /// The entry of a model.
    pub fn model(&self, name: &str) -> Option<&ModelComparison> {
        self.models.iter().find(|m| m.model.to_string() == name)
    }
}
