//! The residuals of a cluster as rows of a linear problem from which the cluster's own variables have been eliminated.

use nalgebra::{DMatrix, DVector};

use super::normal::Normal;

/// Rows of a cluster, such as a frame or a run: what a column added to them would explain.
#[derive(Debug, Clone)]
pub struct ClusterRows {
    /// One row per residual: the cluster's own columns, orthonormal in the metric of their whole information; the shared columns
    /// without what these take up; the residuals without it.
    matrix: DMatrix<f64>,
    /// Normal matrix and gradient of the shared columns, the own ones eliminated.
    hessian: DMatrix<f64>,
    gradient: DVector<f64>,
}

impl ClusterRows {
    /// The rows with the Jacobian `jacobian` of the cluster's `local` own columns followed by the shared ones, whose normal
    /// equations `normal` may have further rows; `None` where these do not determine the own columns.
    pub fn new(jacobian: &DMatrix<f64>, residuals: &DVector<f64>, normal: &Normal, local: usize) -> Option<Self> {
        let Normal { hessian: normal, gradient } = normal;
        let shared = normal.nrows() - local;
        let of_own = normal.view((0, 0), (local, local)).into_owned().cholesky()?;
        let cross = normal.view((0, local), (local, shared)).into_owned();
        let carried = of_own.solve(&cross);
        let own_gradient = gradient.rows(0, local).into_owned();
        let own_step = of_own.solve(&own_gradient);
        let own_columns = jacobian.columns(0, local);
        let mut matrix = DMatrix::zeros(residuals.len(), local + shared + 1);
        // Z = J_p L⁻ᵀ, so that ZᵀZ is what the own columns take up of a column.
        let z = of_own.l().solve_lower_triangular(&own_columns.transpose())?.transpose();
        matrix.columns_mut(0, local).copy_from(&z);
        matrix.columns_mut(local, shared).copy_from(&(jacobian.columns(local, shared) - own_columns * &carried));
        matrix.column_mut(local + shared).copy_from(&(residuals - own_columns * own_step));
        let hessian = normal.view((local, local), (shared, shared)) - cross.tr_mul(&carried);
        let gradient = gradient.rows(local, shared) - carried.tr_mul(&own_gradient);
        Some(Self { matrix, hessian, gradient })
    }

    /// Number of shared columns.
    pub fn shared(&self) -> usize {
        self.gradient.len()
    }

    /// Number of the cluster's own columns.
    pub fn local(&self) -> usize {
        self.matrix.ncols() - self.shared() - 1
    }

    /// ½ Σ r² of its rows, what its own columns take up left out.
    pub fn cost(&self) -> f64 {
        0.5 * self.matrix.column(self.matrix.ncols() - 1).norm_squared()
    }

    /// The rows that columns are multiplied with: own, shared, residual.
    pub fn matrix(&self) -> &DMatrix<f64> {
        &self.matrix
    }

    /// Normal matrix of the shared columns, the own ones eliminated.
    pub fn hessian(&self) -> &DMatrix<f64> {
        &self.hessian
    }

    /// Gradient of the shared columns, the own ones eliminated.
    pub fn gradient(&self) -> &DVector<f64> {
        &self.gradient
    }

    /// Adds a quadratic cost of the shared columns, such as the cluster's share of a prior.
    pub fn add_shared(&mut self, hessian: &DMatrix<f64>, gradient: &DVector<f64>) {
        self.hessian += hessian;
        self.gradient += gradient;
    }

    /// The rows with the residuals after a step of the shared columns and of others.
    #[must_use]
    pub fn shifted(&self, columns: &DMatrix<f64>, step: &DVector<f64>) -> Self {
        let (local, shared) = (self.local(), self.shared());
        let (of_shared, of_others) = (step.rows(0, shared), step.rows(shared, step.len() - shared));
        let change = columns * of_others;
        let products = self.matrix.tr_mul(&change);
        let change = change - self.matrix.columns(0, local) * products.rows(0, local)
            + self.matrix.columns(local, shared) * of_shared;
        let mut rows = self.clone();
        let mut residuals = rows.matrix.column_mut(local + shared);
        residuals += change;
        rows.gradient += products.rows(local, shared) + &self.hessian * of_shared;
        rows
    }

    /// Normal equations over the shared columns and others.
    pub fn normal(&self, columns: &DMatrix<f64>) -> Normal {
        let (local, shared, more) = (self.local(), self.shared(), columns.ncols());
        let products = transposed_product(&self.matrix, columns);
        let of_own = products.rows(0, local);
        let mut hessian = DMatrix::zeros(shared + more, shared + more);
        hessian.view_mut((0, 0), (shared, shared)).copy_from(&self.hessian);
        let cross = products.rows(local, shared);
        hessian.view_mut((0, shared), (shared, more)).copy_from(&cross);
        hessian.view_mut((shared, 0), (more, shared)).copy_from(&cross.transpose());
        let reduced = transposed_product(columns, columns) - of_own.tr_mul(&of_own);
        hessian.view_mut((shared, shared), (more, more)).copy_from(&reduced);
        let mut gradient = DVector::zeros(shared + more);
        gradient.rows_mut(0, shared).copy_from(&self.gradient);
        gradient.rows_mut(shared, more).copy_from(&products.row(local + shared).transpose());
        Normal { hessian, gradient }
    }
}

/// Columns from which on a product by blocks pays the transposed copy.
const MANY: usize = 8;

/// Aᵀ B. `tr_mul` multiplies column by column.
fn transposed_product(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    if b.ncols() < MANY { a.tr_mul(b) } else { a.transpose() * b }
}
