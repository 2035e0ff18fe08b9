//! What can go wrong before and while solving.

use std::borrow::Cow;

use thiserror::Error;

use crate::checkpoint::CheckpointError;
use crate::values::VariableId;

/// A factor cannot be evaluated at these values, for instance because a point lies behind the camera.
///
/// At a trial point of the solver this only rejects the step; at the start it is reported.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{reason}")]
pub struct EvaluationError {
    /// Why, in words.
    pub reason: Cow<'static, str>,
}

impl EvaluationError {
    /// An error with its reason in words.
    pub fn new(reason: impl Into<Cow<'static, str>>) -> Self {
        Self { reason: reason.into() }
    }
}

/// An [`EvaluationError`] with the place where it arose.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("group {group} of factors \"{batch}\": {source}")]
pub struct EvaluationFailure {
    /// Name of the batch.
    pub batch: String,
    /// Group within the batch.
    pub group: usize,
    /// The reason.
    pub source: EvaluationError,
}

/// The graph and the values do not fit together.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum StructureError {
    /// A factor refers to a variable that is not among the values.
    #[error("group {group} of factors \"{batch}\" refers to variable {}, which has no value", variable.0)]
    UnknownVariable {
        /// Name of the batch.
        batch: String,
        /// Group within the batch.
        group: usize,
        /// The variable.
        variable: VariableId,
    },
    /// A group lists the same variable twice.
    #[error("group {group} of factors \"{batch}\" lists {variable} twice")]
    DuplicateVariable {
        /// Name of the batch.
        batch: String,
        /// Group within the batch.
        group: usize,
        /// Label of the variable.
        variable: String,
    },
    /// The number of rows is not a multiple of the residual's dimension.
    #[error(
        "group {group} of factors \"{batch}\" has {rows} rows, not a multiple of the residual dimension {residual_dim}"
    )]
    RowCount {
        /// Name of the batch.
        batch: String,
        /// Group within the batch.
        group: usize,
        /// Rows of the group.
        rows: usize,
        /// Rows per residual.
        residual_dim: usize,
    },
    /// The pattern of a batch in lanes names a column that a group does not have, or does not have a row for every row.
    #[error("the pattern of factors \"{batch}\" does not fit group {group}, whose Jacobian has {columns} columns")]
    Pattern {
        /// Name of the batch.
        batch: String,
        /// Group within the batch.
        group: usize,
        /// Columns of the group's Jacobian.
        columns: usize,
    },
    /// A mask of fixed components has the wrong length.
    #[error("{variable} has {dim} components, but its mask of fixed components has {mask}")]
    MaskLength {
        /// Label of the variable.
        variable: String,
        /// Dimension of the variable.
        dim: usize,
        /// Length of the mask.
        mask: usize,
    },
    /// Bounds that make no sense.
    #[error("bounds on component {component} of {variable}: {reason}")]
    Bound {
        /// Label of the variable.
        variable: String,
        /// The component.
        component: usize,
        /// What is wrong.
        reason: String,
    },
    /// Two variables that share a factor are both to be eliminated.
    #[error("{first} and {second} share a factor in \"{batch}\" and cannot both be eliminated")]
    Elimination {
        /// Name of the batch.
        batch: String,
        /// Label of one variable.
        first: String,
        /// Label of the other.
        second: String,
    },
    /// A loss has parameters that make no sense.
    #[error("the loss of factors \"{batch}\": {reason}")]
    Loss {
        /// Name of the batch.
        batch: String,
        /// What is wrong.
        reason: &'static str,
    },
    /// The problem has no memory layout that the linear algebra accepts.
    #[error("the linear system cannot be set up: {reason}")]
    LinearSystem {
        /// What is wrong.
        reason: String,
    },
}

/// Solving did not start.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SolveError {
    /// A factor cannot be evaluated at the start.
    #[error("the factors cannot be evaluated at the start: {0}")]
    Start(#[from] EvaluationFailure),
    /// Graph and values do not fit together.
    #[error(transparent)]
    Structure(#[from] StructureError),
    /// An option has a value that makes no sense.
    #[error("option {option}: {reason}")]
    Option {
        /// Name of the option.
        option: &'static str,
        /// What is wrong.
        reason: String,
    },
    /// A checkpoint cannot be written or does not fit.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// The executor, an observer or a checkpoint failed.
    #[error("the executor stopped: {reason}")]
    Executor {
        /// What it said.
        reason: String,
    },
}
