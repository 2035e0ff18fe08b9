//! The trait of batches of residuals.

use crate::problem::error::EvaluationError;
use crate::problem::key::VariableId;
use crate::problem::lane::LaneAccess;
use crate::problem::loss::Loss;
use crate::problem::values::Values;

/// A batch of residuals of one kind, divided into groups.
///
/// All residuals of a group depend on the same tuple of variables, for instance all points of a frame on its pose and the
/// camera. The solver evaluates and accumulates a group at a time, and calls a batch from several threads. Implement this
/// trait for full control over evaluation; [`Batch`](crate::Batch) implements it for factors with automatic derivatives.
pub trait FactorBatch: Send + Sync {
    /// Name for reports and errors.
    fn name(&self) -> &str;

    /// Number of groups.
    fn group_count(&self) -> usize;

    /// The variables of a group, each at most once. They must not change while the batch is in a graph.
    fn variables(&self, group: usize) -> &[VariableId];

    /// Number of scalar residuals of a group, a multiple of [`residual_dim`](Self::residual_dim).
    fn row_count(&self, group: usize) -> usize;

    /// Rows per residual; the loss acts on s = ‖r‖² of each residual.
    fn residual_dim(&self) -> usize {
        1
    }

    /// The loss of every residual.
    fn loss(&self) -> Loss {
        Loss::Trivial
    }

    /// Writes the whitened residuals of a group and, if asked for, their Jacobian.
    ///
    /// `residuals` has length [`row_count`](Self::row_count). `jacobian` is row-major, with [`row_count`](Self::row_count)
    /// rows and one column per tangent component of the group's variables, in the order of [`variables`](Self::variables);
    /// it holds the derivatives with respect to the tangent vectors at δ = 0. Every element must be written: the buffers
    /// hold undefined numbers before.
    ///
    /// # Errors
    /// If the residuals do not exist at these values. The solver then rejects the step that led there.
    fn evaluate(
        &self,
        group: usize,
        values: &Values,
        residuals: &mut [f64],
        jacobian: Option<&mut [f64]>,
    ) -> Result<(), EvaluationError>;

    /// Access to evaluation of a group in lanes, if the batch supports it.
    #[doc(hidden)]
    fn lanes(&self, group: usize) -> Option<&dyn LaneAccess> {
        let _ = group;
        None
    }
}
