//! The null space of H, combinations of variables that the residuals do not determine, without a dense factorisation.
//!
//! An eigenvalue λ of H v = λ D² v, with D² the diagonal of H, compares the curvature along v with the curvatures of its
//! components alone. Eigenvectors of vanishing eigenvalues are found by inverse iteration of several vectors at once with
//! the Rayleigh–Ritz method (Golub & Van Loan 2013, section 8.2), using a sparse factorisation of H + μ D² or of the
//! Jacobian.

use nalgebra::DVector;

use crate::normal::normal_equations::NormalEquations;
use crate::uncertainty::gram_schmidt::orthonormalize_in_metric;

/// Eigenvalues up to this belong to the null space: rounding errors of normal equations are smaller.
pub(crate) const RANK_TOLERANCE: f64 = 1e-12;

/// Number of vectors in the first iteration; doubled until not all of them are null vectors.
const VECTORS: usize = 8;
const MAX_ITERATIONS: usize = 40;
/// Relative change below which a Ritz value has converged.
const CONVERGED: f64 = 1e-2;

/// A basis of the null space, orthonormal in the metric D²: eigenvectors of eigenvalues up to `tolerance`. `None` if the
/// factorisation fails. The system must be linearised and must eliminate nothing.
pub(crate) fn null_space(system: &mut NormalEquations, tolerance: f64) -> Option<Vec<DVector<f64>>> {
    let n = system.dim();
    let d2: Vec<f64> = system.diagonal().iter().map(|h| if *h > 0.0 { *h } else { 1.0 }).collect();
    let mu = (10.0 * tolerance).max(system.min_damping());
    if n == 0 {
        return Some(Vec::new());
    }
    if !system.factorize(mu, &d2) {
        return None;
    }
    let mut count = VECTORS.min(n);
    loop {
        let (values, vectors) = smallest(system, mu, &d2, count, tolerance)?;
        let null = values.iter().filter(|v| **v <= tolerance).count();
        if null < count || count == n {
            return Some(vectors.into_iter().take(null).collect());
        }
        count = (2 * count).min(n);
    }
}

/// The `count` smallest eigenvalues, ascending, with their eigenvectors.
fn smallest(
    system: &mut NormalEquations,
    mu: f64,
    d2: &[f64],
    count: usize,
    tolerance: f64,
) -> Option<(Vec<f64>, Vec<DVector<f64>>)> {
    let n = d2.len();
    let mut vectors: Vec<DVector<f64>> = (0..count).map(|k| start(n, k, d2)).collect();
    let mut last: Vec<f64> = vec![f64::INFINITY; count];
    for _ in 0..MAX_ITERATIONS {
        let mut flat: Vec<f64> = vectors.iter().flat_map(|v| v.iter().copied()).collect();
        if !system.inverse_iteration(mu, d2, &mut flat) {
            return None;
        }
        vectors = flat.chunks_exact(n).map(DVector::from_column_slice).collect();
        orthonormalize_in_metric(&mut vectors, d2);
        let (values, basis) = system.ritz(&vectors)?;
        let rotated: Vec<DVector<f64>> = (0..count)
            .map(|k| (0..count).fold(DVector::zeros(n), |sum: DVector<f64>, i| sum + &vectors[i] * basis[(i, k)]))
            .collect();
        vectors = rotated;
        let converged = values.iter().zip(&last).all(|(v, l)| {
            // Eigenvalues far from the tolerance need not converge.
            *v <= 1e-2 * tolerance || *v > 1e3 * tolerance && *l < f64::INFINITY || (l - v).abs() <= CONVERGED * v
        });
        last = values;
        if converged {
            break;
        }
    }
    Some((last, vectors))
}

/// Pseudo-random start vector `k`, the same in every run.
fn start(n: usize, k: usize, d2: &[f64]) -> DVector<f64> {
    let mut state = 0x9e37_79b9_7f4a_7c15_u64.wrapping_mul(k as u64 + 1);
    DVector::from_fn(n, |i, _| {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5) / d2[i].sqrt()
    })
}
