//! Residuals in bins over a covariate, with the formula that describes them, for drawing.

use serde::{Deserialize, Serialize};

/// Residuals and a formula over its first covariate, for a part of the range of the second one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct DiagnosisComponent {
    /// The covariate.
    pub over: String,
    /// The part of the range of the second covariate; absent for formulas of one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub part_of: Option<DiagnosisCovariatePart>,
    /// Bins over the covariate.
    pub bins: Vec<DiagnosisComponentBin>,
}

/// A part of the range of a covariate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct DiagnosisCovariatePart {
    /// The covariate.
    pub covariate: String,
    /// Its ends.
    pub range: [f64; 2],
}

/// Means over the depth samples of a bin.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct DiagnosisComponentBin {
    /// The covariate.
    pub at: f64,
    /// Measured depth minus that of the model without the formula, mm.
    pub residual_mm: f64,
    /// Its standard error over frames, mm; absent where a single frame is in the bin.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub standard_error_mm: Option<f64>,
    /// Millimetres that the formula adds to measured depth.
    pub formula_mm: f64,
}
