//! Errors of a diagnosis.

use depthcal_formula::FormulaError;
use depthcal_solver::score::ScoreError;
use depthcal_solver::{NoiseError, SolveError};
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
    #[error(
        "the dataset '{dataset}' has no depth images: a diagnosis needs depth; add frames.depth, or depth to a section [cameras.NAME], \
             to dataset.toml"
    )]
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
    /// One camera of several cannot be diagnosed.
    #[error("camera {camera}: {source}")]
    Camera {
        /// The camera.
        camera: String,
        /// Why.
        source: Box<DiagnoseError>,
    },
    /// A formula that was found cannot be a piece.
    #[error(transparent)]
    Formula(Box<FormulaError>),
    /// The fit lacks a camera that was captured.
    #[error("the calibration has no camera {camera} although it was captured: please report this as a bug")]
    LacksCamera {
        /// The camera.
        camera: String,
    },
}

impl From<FormulaError> for DiagnoseError {
    fn from(error: FormulaError) -> Self {
        Self::Formula(Box::new(error))
    }
}

impl From<SolveError> for DiagnoseError {
    fn from(error: SolveError) -> Self {
        Self::Calibrate(error.into())
    }
}

impl From<NoiseError> for DiagnoseError {
    fn from(error: NoiseError) -> Self {
        Self::Calibrate(error.into())
    }
}

impl DiagnoseError {
    /// Whether the fit itself cannot be trusted (rather than the input being at fault).
    pub fn is_untrusted_fit(&self) -> bool {
        match self {
            Self::Calibrate(error) => error.is_untrusted_fit(),
            Self::Camera { source, .. } => source.is_untrusted_fit(),
            Self::Score(_) | Self::NotFitted { .. } | Self::LacksCamera { .. } => true,
            Self::NoDepth { .. } | Self::Formula(_) => false,
        }
    }
}
