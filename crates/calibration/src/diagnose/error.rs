//! Errors of a diagnosis.

use depthcal_solver::score::ScoreError;
use thiserror::Error;

use crate::calibrate::CalibrateError;

/// Why there is no diagnosis.
#[derive(Debug, Error)]
pub enum DiagnoseError {
    /// The declared model cannot be fitted.
    #[error(transparent)]
    Calibrate(#[from] CalibrateError),
    /// The problem of a fit cannot be linearised.
    #[error("the fit cannot be examined: {0}")]
    Score(#[from] ScoreError),
    /// There is no depth.
    #[error("the dataset '{dataset}' has no depth images: a diagnosis needs depth; add frames.depth to dataset.toml")]
    NoDepth {
        /// The dataset.
        dataset: String,
    },
    /// The last fit lacks the block of an effect that was added to it.
    #[error(
        "the fitted camera has no piece '{effect}' although it was added to the model: please report this as a bug"
    )]
    NotFitted {
        /// The effect's name.
        effect: String,
    },
}

impl DiagnoseError {
    /// Whether the fit itself cannot be trusted (rather than the input being at fault).
    pub fn is_untrusted_fit(&self) -> bool {
        match self {
            Self::Calibrate(error) => error.is_untrusted_fit(),
            Self::Score(_) | Self::NotFitted { .. } => true,
            Self::NoDepth { .. } => false,
        }
    }
}
