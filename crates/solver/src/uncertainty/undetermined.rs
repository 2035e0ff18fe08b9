//! The undetermined combinations of variables of a problem.

use crate::plan::linear_solver::LinearSolver;
use crate::problem::graph::Graph;
use crate::problem::values::Values;
use crate::uncertainty::error::CovarianceError;
use crate::uncertainty::gram_schmidt::orthonormalize;
use crate::uncertainty::linearized::linearized;
use crate::uncertainty::null_direction::{NullDirection, name_direction};
use crate::uncertainty::null_space::{RANK_TOLERANCE, null_space};

/// The rank tolerance for a factorisation of the Jacobian, whose rounding errors are those of normal equations squared.
const ROWS_RANK_TOLERANCE: f64 = 1e-24;

/// The combinations of variables that the residuals do not determine at these values: by QR of the Jacobian if `by_rows`,
/// else by Cholesky factorisation of the normal equations. `None` if the factorisation fails.
pub(crate) fn undetermined(
    graph: &Graph,
    values: &Values,
    by_rows: bool,
) -> Result<Option<Vec<NullDirection>>, CovarianceError> {
    let (linear_solver, tolerance) = if by_rows {
        (LinearSolver::SparseQr, ROWS_RANK_TOLERANCE)
    } else {
        (LinearSolver::SparseCholesky, RANK_TOLERANCE)
    };
    let (mut system, _) = linearized(graph, values, linear_solver)?;
    let Some(mut null) = null_space(&mut system, tolerance) else { return Ok(None) };
    orthonormalize(&mut null);
    Ok(Some(null.iter().map(|v| name_direction(graph, &system, v)).collect()))
}
