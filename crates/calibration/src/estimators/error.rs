//! Why an estimator gives no D.

use thiserror::Error;

/// Why an estimator gives no D.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum EstimatorError {
    /// The estimator knows the projective model only.
    #[error(
        "the estimator '{estimator}' fits the model 'projective' and its subsets only, not '{model}': use --estimator joint"
    )]
    NotProjective {
        /// The estimator.
        estimator: &'static str,
        /// The model asked for.
        model: String,
    },
    /// Too few markers have depth.
    #[error("only {found} markers have valid depth around them, but {needed} are needed")]
    TooFewPoints {
        /// Markers with depth.
        found: usize,
        /// Markers needed.
        needed: usize,
    },
    /// All points in one plane, or otherwise degenerate.
    #[error(
        "the markers do not determine D (free: {free}): capture the board at several distances and tilts, or use a subset \
         such as projective:xw"
    )]
    Degenerate {
        /// The free parameters.
        free: String,
    },
}

/// The names of the free parameters of D, for messages.
pub(super) fn free_names(free: [bool; 4]) -> String {
    ["dx", "dy", "dz", "dw"].iter().zip(free).filter(|(_, f)| *f).map(|(n, _)| *n).collect::<Vec<_>>().join(", ")
}
