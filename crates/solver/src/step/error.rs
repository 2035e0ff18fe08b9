//! Errors of solving a problem.

use thiserror::Error;

use crate::problem::error::{EvaluationFailure, StructureError};
use crate::step::checkpoint_error::CheckpointError;

/// A problem was not solved.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SolveError {
    /// A factor cannot be evaluated at the start values.
    #[error("the factors cannot be evaluated at the start values: {0}")]
    Start(#[from] EvaluationFailure),
    /// Graph and values do not fit together.
    #[error(transparent)]
    Structure(#[from] StructureError),
    /// An option has a value out of its range.
    #[error("option {option}: {reason}")]
    Option {
        /// Name of the option.
        option: &'static str,
        /// The fault.
        reason: String,
    },
    /// A checkpoint cannot be read or written, or belongs to another problem.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// argmin's executor or an observer failed.
    #[error("argmin's executor failed: {reason}")]
    Executor {
        /// Its message.
        reason: String,
    },
}
