//! Degrees of freedom that are left in a part of the residuals.

use depthcal_solver::{Covariance, FactorBatch, Values};
use nalgebra::DMatrixView;
use rayon::prelude::*;

/// Redundancy of the residuals of a batch, whose loss is quadratic near zero: n − tr(W J Σ Jᵀ) (Förstner 1979; Koch 1999, section
/// 3.6.1).
pub fn batch_redundancy(batch: &dyn FactorBatch, values: &Values, covariance: &Covariance) -> f64 {
    let redundancy = |group: usize| {
        let ids = batch.variables(group);
        let columns: usize = ids.iter().map(|id| values.dim(*id)).sum();
        let rows = batch.row_count(group);
        let (mut r, mut j) = (vec![0.0; rows], vec![0.0; rows * columns]);
        if batch.evaluate(group, values, &mut r, Some(&mut j)).is_err() {
            return rows as f64;
        }
        // The trace of J Σ Jᵀ is that of Σ Jᵀ J. The transposed J is what lies in memory.
        let transposed = DMatrixView::from_slice(&j, columns, rows);
        let products = transposed * transposed.transpose();
        // What a residual within the loss's quadratic part weighs.
        let weight = batch.loss().evaluate(0.0)[1];
        rows as f64 - weight * covariance.joint(ids).component_mul(&products).sum()
    };
    let groups: Vec<f64> = (0..batch.group_count()).into_par_iter().map(redundancy).collect();
    groups.iter().sum()
}
