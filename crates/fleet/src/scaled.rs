//! Linear algebra of symmetric positive definite matrices whose rows differ by many orders of magnitude.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, SymmetricEigen};

/// Cholesky factorisation of a matrix scaled to a unit diagonal.
pub(crate) struct Scaled {
    scale: DVector<f64>,
    cholesky: Cholesky<f64, Dyn>,
}

impl Scaled {
    /// Factorises; `None` where the matrix is not positive definite.
    pub fn new(matrix: &DMatrix<f64>) -> Option<Self> {
        Self::with_ridge(matrix, 0.0)
    }

    /// Factorises the matrix with `ridge` times its diagonal added: combinations that it leaves undetermined have a large, finite
    /// variance.
    pub fn with_ridge(matrix: &DMatrix<f64>, ridge: f64) -> Option<Self> {
        let n = matrix.nrows();
        let scale = matrix.diagonal().map(|v| if v > 0.0 { 1.0 / v.sqrt() } else { f64::NAN });
        let scaled =
            DMatrix::from_fn(n, n, |i, k| scale[i] * matrix[(i, k)] * scale[k] + if i == k { ridge } else { 0.0 });
        let finite = scaled.iter().all(|v| v.is_finite());
        Some(Self { cholesky: finite.then(|| scaled.cholesky()).flatten()?, scale })
    }

    /// The inverse.
    pub fn inverse(&self) -> DMatrix<f64> {
        let inverse = self.cholesky.inverse();
        let n = inverse.nrows();
        DMatrix::from_fn(n, n, |i, k| 0.5 * (inverse[(i, k)] + inverse[(k, i)]) * self.scale[i] * self.scale[k])
    }

    /// Logarithm of the determinant.
    pub fn log_determinant(&self) -> f64 {
        let factor = self.cholesky.l_dirty();
        (0..self.scale.len()).map(|i| 2.0 * (factor[(i, i)].ln() - self.scale[i].ln())).sum()
    }
}

/// The part of a matrix with the given rows and columns.
pub(crate) fn part(matrix: &DMatrix<f64>, rows: &[usize], columns: &[usize]) -> DMatrix<f64> {
    DMatrix::from_fn(rows.len(), columns.len(), |i, k| matrix[(rows[i], columns[k])])
}

/// The elements of a vector at the given places.
pub(crate) fn picked(vector: &DVector<f64>, places: &[usize]) -> DVector<f64> {
    DVector::from_fn(places.len(), |i, _| vector[places[i]])
}

/// Standardised and decorrelated components of a departure with this covariance: each remains as close as possible to its own
/// parameter, whatever their order (ZCA-cor; Kessy, Lewin, Strimmer 2018). `None` where the covariance is not positive definite.
pub(crate) fn decorrelated(departure: &DVector<f64>, covariance: &DMatrix<f64>) -> Option<DVector<f64>> {
    let n = departure.len();
    let std = covariance.diagonal().map(f64::sqrt);
    if !std.iter().all(|s| *s > 0.0 && s.is_finite()) {
        return None;
    }
    let correlation = DMatrix::from_fn(n, n, |i, k| covariance[(i, k)] / (std[i] * std[k]));
    let eigen = SymmetricEigen::new(correlation);
    if !eigen.eigenvalues.iter().all(|v| *v > 1e-13) {
        return None;
    }
    let along = eigen.eigenvectors.tr_mul(&departure.component_div(&std));
    Some(&eigen.eigenvectors * along.component_div(&eigen.eigenvalues.map(f64::sqrt)))
}
