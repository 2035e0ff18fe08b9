//! The functions that were searched in what the last model of a diagnosis leaves.

use serde::{Deserialize, Serialize};

/// Smooth functions that were searched in what the last model leaves, none of which lowers the error on left-out frames for
/// certain. Covariates have their names of formulas.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct DiagnosisSearched {
    /// Covariates whose functions were searched, singly and two at a time.
    pub functions_of: Vec<String>,
    /// Covariates that these functions were multiplied with.
    pub times: Vec<String>,
    /// Pairs of covariates whose functions were searched that are no such products.
    pub functions_of_pairs: Vec<[String; 2]>,
    /// Covariates that the frames do not have, or that are the same in all of them.
    pub unknown: Vec<String>,
}
