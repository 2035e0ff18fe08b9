//! The lenses that a calibration was chosen from.

use serde::{Deserialize, Serialize};

/// Lens models compared on left-out frames, the simplest first; the one that was chosen is the simplest within one standard error
/// of the best.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct LensComparison {
    /// Name of the chosen lens model.
    pub chosen: String,
    /// The lenses that were compared.
    pub lenses: Vec<ComparedLens>,
}

/// One lens model of a comparison.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct ComparedLens {
    /// Its name, as given to `--lens`.
    pub lens: String,
    /// Number of its fitted parameters.
    pub parameters: usize,
    /// Root mean square reprojection error of left-out frames, px, whose poses follow from their own markers; absent where it
    /// could not be fitted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub held_out_px: Option<f64>,
    /// Mean over frames of its squared error less the best lens', in standard errors; 0 for the best.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub worse_by_standard_errors: Option<f64>,
    /// Whether it is one-to-one over the whole image.
    pub one_to_one: bool,
    /// Why it could not be fitted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failed: Option<String>,
}
