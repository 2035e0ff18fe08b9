//! Why there is no calibration.

use depthcal_model::{CameraError, RegisterError};
use depthcal_solver::{CovarianceError, SolveError};
use thiserror::Error;

use depthcal_io::ImageError;

use super::depth_scale::ImplausibleScale;
use super::undetermined::UndeterminedModel;
use crate::estimators::EstimatorError;
use crate::start::StartError;

/// Why there is no calibration.
#[derive(Debug, Error)]
pub enum CalibrateError {
    /// No start values.
    #[error(transparent)]
    Start(#[from] StartError),
    /// An image cannot be read.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// A model's name is wrong.
    #[error(transparent)]
    Register(#[from] RegisterError),
    /// The solver failed.
    #[error("the adjustment failed: {0}")]
    Solve(#[from] SolveError),
    /// It stopped before it had converged.
    #[error("the adjustment did not converge ({reason}); its result cannot be trusted")]
    NotConverged {
        /// The solver's words.
        reason: String,
    },
    /// The data leave parameters undetermined.
    #[error("{0}")]
    Undetermined(Box<UndeterminedModel>),
    /// The covariance cannot be computed for another reason.
    #[error("the precision of the model cannot be computed: {0}")]
    Covariance(#[from] CovarianceError),
    /// A parameter is to be held that the model does not have.
    #[error("there is no parameter '{held}' to be held; the model has {}", known.join(", "))]
    UnknownHeld {
        /// The parameter as it was asked for.
        held: String,
        /// The parameters of the model.
        known: Vec<String>,
    },
    /// A focal length is to be held, but no value is declared.
    #[error("'{held}' has no value at which it could be held: declare it under [camera] in dataset.toml")]
    HeldWithoutValue {
        /// The parameter as it was asked for.
        held: String,
    },
    /// An estimator of D failed.
    #[error(transparent)]
    Estimator(#[from] EstimatorError),
    /// A depth model was asked for, but there is no depth.
    #[error(
        "the dataset '{dataset}' has no depth images, so the depth model '{model}' cannot be fitted: add depth to \
         dataset.toml or use --model none"
    )]
    NoDepth {
        /// The dataset.
        dataset: String,
        /// The model asked for.
        model: String,
    },
    /// No valid depth on the board.
    #[error(
        "no valid depth pixel lies on the board in any frame of '{dataset}': check depth.unit_mm and that depth and \
             image share one pixel grid"
    )]
    NoDepthOnBoard {
        /// The dataset.
        dataset: String,
    },
    /// Depth and image disagree by a factor that no camera has.
    #[error(transparent)]
    Scale(#[from] ImplausibleScale),
    /// The fitted camera cannot be inverted where it was fitted.
    #[error("the fitted model folds: {0}")]
    Folded(#[from] CameraError),
}

impl CalibrateError {
    /// Whether the fit itself cannot be trusted (rather than the input being at fault).
    pub fn is_untrusted_fit(&self) -> bool {
        matches!(
            self,
            Self::Solve(_) | Self::NotConverged { .. } | Self::Undetermined(_) | Self::Covariance(_) | Self::Folded(_)
        )
    }
}
