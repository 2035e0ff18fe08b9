//! Errors of incremental sessions.

use thiserror::Error;

use crate::problem::error::{EvaluationFailure, StructureError};
use crate::step::error::SolveError;

/// A frame cannot be added, or a session cannot go on.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum IncrementalError {
    /// The frame's own variables could not be solved for, with the shared ones held.
    #[error("the frame alone: {0}")]
    Solve(#[from] SolveError),
    /// Graph and values of the frame do not fit together.
    #[error(transparent)]
    Structure(#[from] StructureError),
    /// A frame cannot be evaluated at the present values.
    #[error(transparent)]
    Evaluation(#[from] EvaluationFailure),
    /// The frame's residuals do not determine its own variables.
    #[error(
        "the residuals of the frame do not determine the frame's own variables; add a prior, or leave the frame out"
    )]
    Undetermined,
    /// The frame fixes a shared variable, or frees one.
    #[error("a frame fixes shared variable {variable} or frees it; fix shared variables in the graph of the session")]
    Fixed {
        /// Label of the variable.
        variable: String,
    },
    /// The frame bounds a variable.
    #[error("an incremental session has no bounds; remove them from the frame's graph")]
    Bounds,
    /// There is no such frame, or it has been removed.
    #[error("frame {frame} is not in the session")]
    UnknownFrame {
        /// Number of the frame, in the order of additions.
        frame: u64,
    },
    /// The threads could not be started.
    #[error("the threads could not be started: {reason}")]
    Threads {
        /// The message of the system.
        reason: String,
    },
}
