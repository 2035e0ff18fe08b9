//! Errors of evaluating factors, and of a graph and values that do not fit together.

use std::borrow::Cow;

use thiserror::Error;

use crate::problem::key::VariableId;

/// A factor cannot be evaluated at these values, for instance because a point lies behind the camera.
///
/// At a trial point the solver rejects the step and goes on; at the start values it is an error.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{reason}")]
pub struct EvaluationError {
    /// The reason, as a clause for a message.
    pub reason: Cow<'static, str>,
}

impl EvaluationError {
    /// An error with this reason.
    pub fn new(reason: impl Into<Cow<'static, str>>) -> Self {
        Self { reason: reason.into() }
    }
}

/// An [`EvaluationError`] with the batch and group in which it arose.
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
    #[error(
        "group {group} of factors \"{batch}\" refers to variable {}, which has no value; use keys of the values to be solved",
        variable.index()
    )]
    UnknownVariable {
        /// Name of the batch.
        batch: String,
        /// Group within the batch.
        group: usize,
        /// The variable.
        variable: VariableId,
    },
    /// A group lists the same variable twice.
    #[error("group {group} of factors \"{batch}\" lists {variable} twice; a group's variables must be distinct")]
    DuplicateVariable {
        /// Name of the batch.
        batch: String,
        /// Group within the batch.
        group: usize,
        /// Label of the variable.
        variable: String,
    },
    /// A group's number of rows is not a multiple of the residual's dimension.
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
    /// A mask of fixed components has the wrong length.
    #[error("{variable} has {dim} components, but its mask of fixed components has {mask} entries")]
    MaskLength {
        /// Label of the variable.
        variable: String,
        /// Dimension of the variable.
        dim: usize,
        /// Length of the mask.
        mask: usize,
    },
    /// Bounds that cannot be met or that apply to no coordinate.
    #[error("bounds on component {component} of {variable}: {reason}")]
    Bound {
        /// Label of the variable.
        variable: String,
        /// Tangent component.
        component: usize,
        /// The fault.
        reason: String,
    },
    /// Two of the variables given to [`Graph::eliminate`](crate::Graph::eliminate) share a factor.
    #[error(
        "{first} and {second} share a factor in \"{batch}\" and cannot both be eliminated; leave one out of Graph::eliminate"
    )]
    Elimination {
        /// Name of the batch.
        batch: String,
        /// Label of one variable.
        first: String,
        /// Label of the other.
        second: String,
    },
    /// A loss has parameters out of their range.
    #[error("the loss of factors \"{batch}\": {reason}")]
    Loss {
        /// Name of the batch.
        batch: String,
        /// The fault.
        reason: &'static str,
    },
    /// The linear algebra refused the problem's structure, for instance because it is too large.
    #[error("the linear system cannot be set up: {reason}")]
    LinearSystem {
        /// The fault.
        reason: String,
    },
}
