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
    let scaled_rhs = rhs.component_mul(&scale);
    let solution = match regular_cholesky(scaled.clone(), negligible) {
        Some(cholesky) => cholesky.solve(&scaled_rhs),
        None => {
            let eigen = SymmetricEigen::new(scaled);
            let along = eigen.eigenvectors.tr_mul(&scaled_rhs);
            let divided =
                along.zip_map(&eigen.eigenvalues, |x, value| if value > negligible { x / value } else { 0.0 });
            eigen.eigenvectors * divided
        }
    };
    solution.component_mul(&scale)
}

/// The Cholesky factorisation of a matrix with a unit diagonal, if all pivots are well above the limit: far cheaper than
/// eigenvalues.
fn regular_cholesky(scaled: DMatrix<f64>, negligible: f64) -> Option<Cholesky<f64, Dyn>> {
    let cholesky = scaled.cholesky()?;
    let pivots = cholesky.l_dirty().diagonal();
    pivots.iter().all(|p| p * p > 1e3 * negligible).then_some(cholesky)
}

/// [`pseudo_inverse`] relative to another scale: `alone`, the curvatures of the components before projection or elimination. Also
/// returns the rank.
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A regular matrix, one of rank 2, and one with a component of no curvature, whose columns differ by ten orders of
    /// magnitude.
    fn matrices() -> [(DMatrix<f64>, usize); 3] {
        let j = DMatrix::from_row_slice(4, 3, &[1.0, 0.2, -0.3, 0.4, 2.0, 0.1, -0.7, 0.3, 1.5, 0.2, 0.2, 0.9]);
        let gram = |j: &DMatrix<f64>| j.tr_mul(j);
        let scaled = DMatrix::from_fn(4, 3, |i, k| j[(i, k)] * [1e-5, 1.0, 1e5][k]);
        let mut twins = scaled.clone();
        twins.set_column(2, &(scaled.column(0) * 3.0));
        let mut without = scaled.clone();
        without.set_column(1, &DVector::zeros(4));
        [(gram(&scaled), 3), (gram(&twins), 2), (gram(&without), 2)]
    }

    /// A A⁺ A = A and A⁺ A A⁺ = A⁺ (Penrose 1955), in units in which the diagonal is 1.
    #[test]
    fn pseudo_inverses_invert_on_the_range() {
        for (a, expected_rank) in matrices() {
            let (inverse, rank) = pseudo_inverse_scaled(&a, &a.diagonal(), NEGLIGIBLE);
            assert_eq!(rank, expected_rank);
            let size = a.diagonal().map(|d| if d > 0.0 { d.sqrt() } else { 1.0 });
            let unit = |m: DMatrix<f64>| DMatrix::from_fn(3, 3, |i, k| m[(i, k)] / size[i] / size[k]);
            let inverse_unit = DMatrix::from_fn(3, 3, |i, k| inverse[(i, k)] * size[i] * size[k]);
            let a_unit = unit(a.clone());
            assert!((&a_unit * &inverse_unit * &a_unit - &a_unit).amax() < 1e-12);
            assert!((&inverse_unit * &a_unit * &inverse_unit - &inverse_unit).amax() < 1e-12 * inverse_unit.amax());
            assert_eq!(pseudo_inverse(&a, NEGLIGIBLE), inverse);
            let rhs = &a * DVector::from_vec(vec![1e5, -2.0, 3e-5]);
            let (solved, product) = (pseudo_solve(&a, &rhs, NEGLIGIBLE), &inverse * &rhs);
            assert!((&solved - &product).component_mul(&size).amax() < 1e-9, "{solved} {product}");
        }
    }

    /// Well-scaled matrices, which a wrong scale leaves positive definite: solved by hand.
    #[test]
    fn regular_systems_are_solved() {
        let solve = |a: &[f64], rhs: &[f64]| {
            let n = rhs.len();
            pseudo_solve(&DMatrix::from_row_slice(n, n, a), &DVector::from_row_slice(rhs), NEGLIGIBLE)
        };
        assert!((solve(&[4.0], &[2.0])[0] - 0.5).abs() < 1e-15);
        let x = solve(&[4.0, 1.0, 1.0, 3.0], &[1.0, 2.0]);
        assert!((x[0] - 1.0 / 11.0).abs() < 1e-15 && (x[1] - 7.0 / 11.0).abs() < 1e-15, "{x}");
    }

    /// Curvatures before a projection say what counts as nothing after it.
    #[test]
    fn what_a_projection_leaves_is_judged_by_what_was_there() {
        let left = DMatrix::from_diagonal(&DVector::from_vec(vec![1e-13, 2.0]));
        let (inverse, rank) = pseudo_inverse_scaled(&left, &DVector::from_vec(vec![1.0, 4.0]), NEGLIGIBLE);
        assert_eq!((rank, inverse[(0, 0)]), (1, 0.0));
        assert!((inverse[(1, 1)] - 0.5).abs() < 1e-15);
        assert_eq!(pseudo_inverse_scaled(&left, &left.diagonal(), NEGLIGIBLE).1, 2);
        assert_eq!(
            pseudo_inverse_scaled(&DMatrix::zeros(0, 0), &DVector::zeros(0), NEGLIGIBLE),
            (DMatrix::zeros(0, 0), 0)
        );
    }
}
