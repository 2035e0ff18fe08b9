//! The residuals of a diagnosis' last model, and the part of them that no function of one covariate could remove.

use serde::{Deserialize, Serialize};

use super::covariate::DiagnosisCovariate;

/// The residuals of the last model, and the pure error: the part of them that different frames do not share at the same values of
/// any covariate, and that no function of one covariate could remove.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct DiagnosisPureError {
    /// Root mean square of the depth residuals over the board pixels, mm.
    pub residual_rms_mm: f64,
    /// Root mean square of the pure error, mm.
    pub pure_error_mm: f64,
    /// The first over the second; 1 where frames share nothing for certain.
    pub ratio: f64,
    /// Errors that frames certainly share, by falling size.
    pub shared: Vec<DiagnosisShared>,
    /// Law and correlation of the pure error.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise: Option<DiagnosisPureNoise>,
}

/// The noise of depth that the pure error has: what frames share is in neither number.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct DiagnosisPureNoise {
    /// a of σ_ρ² = a² + (b ρ²)², 1/mm.
    pub a_per_mm: f64,
    /// b of it, mm.
    pub b_mm: f64,
    /// Its standard deviation at near, middle and far depths of the captures.
    pub at: Vec<DiagnosisNoiseAtDepth>,
    /// Distance in the image at which pixels are nearly uncorrelated, px; absent where single pixels were captured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub correlation_length_px: Option<usize>,
}

/// Standard deviation of a pixel's depth at a depth.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct DiagnosisNoiseAtDepth {
    /// Depth, mm.
    pub depth_mm: f64,
    /// Standard deviation, mm.
    pub std_mm: f64,
}

/// Residuals that different frames share at the same value of a covariate, or of two together.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct DiagnosisShared {
    /// The covariates.
    pub along: Vec<DiagnosisCovariate>,
    /// Scale at which it is most certain: px, mm on the board or of depth, e-folds of amplitude, cosine of the angle of
    /// incidence; absent for two covariates.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale: Option<f64>,
    /// Root mean square, mm.
    pub rms_mm: f64,
    /// Statistic at that scale, in standard deviations of what chance gives.
    pub z: f64,
    /// p-value, corrected for the number of scales and covariates.
    pub p_value: f64,
}
