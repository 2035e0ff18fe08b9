//! Comparison of Jacobians with finite differences.

use crate::problem::error::EvaluationFailure;
use crate::problem::factor_batch::FactorBatch;
use crate::problem::graph::{BatchId, Graph};
use crate::problem::values::Values;

/// The entry of a batch's Jacobian that disagrees most with central differences.
#[derive(Clone, Debug, PartialEq)]
pub struct JacobianError {
    /// The batch.
    pub batch: BatchId,
    /// Group within the batch.
    pub group: usize,
    /// Row of the group's Jacobian.
    pub row: usize,
    /// Column of the group's Jacobian.
    pub column: usize,
    /// The entry that the batch computes.
    pub given: f64,
    /// The central difference of its residuals.
    pub difference: f64,
    /// |given − difference| / max(1, largest absolute value in the row of the Jacobian).
    pub error: f64,
}

/// Compares every batch's Jacobian with central differences of its residuals over retractions by ± `step`, and returns the
/// worst entry of each batch. With steps near 1e-5 and smooth residuals of moderate size, errors of a correct Jacobian are
/// below 1e-7.
///
/// # Errors
/// If a batch cannot be evaluated at the values or close to them.
pub fn check_jacobians(graph: &Graph, values: &Values, step: f64) -> Result<Vec<JacobianError>, EvaluationFailure> {
    let mut worst = Vec::new();
    for (id, batch) in graph.batches() {
        let mut of_batch: Option<JacobianError> = None;
        for group in 0..batch.group_count() {
            let error = check_group(id, batch, group, values, step)?;
            if let Some(error) = error
                && of_batch.as_ref().is_none_or(|w| error.error > w.error || error.error.is_nan())
            {
                of_batch = Some(error);
            }
        }
        worst.extend(of_batch);
    }
    Ok(worst)
}

fn check_group(
    id: BatchId,
    batch: &dyn FactorBatch,
    group: usize,
    values: &Values,
    step: f64,
) -> Result<Option<JacobianError>, EvaluationFailure> {
    let failure = |source| EvaluationFailure { batch: batch.name().to_owned(), group, source };
    let rows = batch.row_count(group);
    let columns: usize = batch.variables(group).iter().map(|v| values.dim(*v)).sum();
    let mut residuals = vec![0.0; rows];
    let mut jacobian = vec![f64::NAN; rows * columns];
    batch.evaluate(group, values, &mut residuals, Some(&mut jacobian)).map_err(failure)?;
    let mut worst: Option<JacobianError> = None;
    let (mut above, mut below) = (vec![0.0; rows], vec![0.0; rows]);
    let mut column = 0;
    for variable in batch.variables(group) {
        let dim = values.dim(*variable);
        for k in 0..dim {
            for (sign, r) in [(1.0, &mut above), (-1.0, &mut below)] {
                let mut delta = vec![0.0; dim];
                delta[k] = sign * step;
                let mut moved = values.clone();
                moved.retract(*variable, &delta);
                batch.evaluate(group, &moved, r, None).map_err(failure)?;
            }
            for row in 0..rows {
                let given = jacobian[row * columns + column];
                let difference = (above[row] - below[row]) / (2.0 * step);
                let entries = &jacobian[row * columns..(row + 1) * columns];
                let scale = entries.iter().fold(1.0, |max: f64, j| max.max(j.abs()));
                let error = (given - difference).abs() / scale;
                if worst.as_ref().is_none_or(|w| error > w.error || error.is_nan()) {
                    worst = Some(JacobianError { batch: id, group, row, column, given, difference, error });
                }
            }
            column += 1;
        }
    }
    Ok(worst)
}
