//! Pseudo-inverses of positive semidefinite matrices.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, SymmetricEigen};

/// Eigenvalues below this, of a matrix scaled to a unit diagonal, count as zero.
pub(super) const NEGLIGIBLE: f64 = 1e-11;

/// The inverse of a positive semidefinite matrix on its range: of the matrix scaled to a unit diagonal, eigenvalues up to
/// `negligible` count as zero.
pub(super) fn pseudo_inverse(matrix: &DMatrix<f64>, negligible: f64) -> DMatrix<f64> {
    pseudo_inverse_scaled(matrix, &matrix.diagonal(), negligible).0
}

/// The product of [`pseudo_inverse`] and a vector, without the inverse where the matrix is regular.
pub(super) fn pseudo_solve(matrix: &DMatrix<f64>, rhs: &DVector<f64>, negligible: f64) -> DVector<f64> {
    let n = matrix.nrows();
    let scale = matrix.diagonal().map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 });
    let scaled = DMatrix::from_fn(n, n, |i, k| scale[i] * matrix[(i, k)] * scale[k]);
    match regular_cholesky(scaled, negligible) {
        Some(cholesky) => cholesky.solve(&rhs.component_mul(&scale)).component_mul(&scale),
        None => pseudo_inverse(matrix, negligible) * rhs,
    }
}

/// The Cholesky factorisation of a matrix with a unit diagonal, if all pivots are well above the limit: far cheaper than
/// eigenvalues.
fn regular_cholesky(scaled: DMatrix<f64>, negligible: f64) -> Option<Cholesky<f64, Dyn>> {
    let cholesky = scaled.cholesky()?;
    let pivots = cholesky.l_dirty().diagonal();
    pivots.iter().all(|p| p * p > 1e3 * negligible).then_some(cholesky)
}

/// The same with another scale: `alone`, the curvatures of the components before projection or elimination. Also returns the
/// rank.
pub(super) fn pseudo_inverse_scaled(
    matrix: &DMatrix<f64>,
    alone: &DVector<f64>,
    negligible: f64,
) -> (DMatrix<f64>, usize) {
    let n = matrix.nrows();
    if n == 0 {
        return (matrix.clone(), 0);
    }
    let scale = alone.map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 });
    let scaled = DMatrix::from_fn(n, n, |i, k| scale[i] * matrix[(i, k)] * scale[k]);
    if let Some(cholesky) = regular_cholesky(scaled.clone(), negligible) {
        let inverse = cholesky.inverse();
        return (DMatrix::from_fn(n, n, |i, k| scale[i] * inverse[(i, k)] * scale[k]), n);
    }
    let eigen = SymmetricEigen::new(scaled);
    let mut inverse = DMatrix::zeros(n, n);
    let mut rank = 0;
    for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        if *value > negligible {
            inverse.ger(1.0 / value, &vector, &vector, 1.0);
            rank += 1;
        }
    }
    (DMatrix::from_fn(n, n, |i, k| scale[i] * inverse[(i, k)] * scale[k]), rank)
}
