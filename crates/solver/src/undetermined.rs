//! Combinations of variables that the residuals do not determine, without a dense factorisation.
//!
//! The eigenvalues λ of H v = λ D² v with D² the diagonal of H compare the curvature of a combination with what its
//! components would have alone. Those that vanish are found by inverse iteration of several vectors at once with the
//! Rayleigh–Ritz method (Golub & Van Loan 2013, section 8.2), on the sparse factorisation of H + μ D² or of the Jacobian.

use nalgebra::DVector;

use crate::normal::NormalEquations;

/// Vectors that are iterated at first.
const VECTORS: usize = 8;
const MAX_ITERATIONS: usize = 40;
/// A Ritz value that changes by less than this, relatively, has settled.
const SETTLED: f64 = 1e-2;

/// A basis of the undetermined combinations, orthonormal in the metric D²: eigenvalues up to `tolerance`. Nothing if the
/// factorisation fails. Nothing may be eliminated in the system, which has to be linearised.
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

/// The smallest eigenvalues, ascending, with their vectors.
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
        orthonormalize(&mut vectors, d2);
        let (values, basis) = system.ritz(&vectors)?;
        let rotated: Vec<DVector<f64>> = (0..count)
            .map(|k| (0..count).fold(DVector::zeros(n), |sum: DVector<f64>, i| sum + &vectors[i] * basis[(i, k)]))
            .collect();
        vectors = rotated;
        let settled = values.iter().zip(&last).all(|(v, l)| {
            // What is far from the tolerance need not settle.
            *v <= 1e-2 * tolerance || *v > 1e3 * tolerance && *l < f64::INFINITY || (l - v).abs() <= SETTLED * v
        });
        last = values;
        if settled {
            break;
        }
    }
    Some((last, vectors))
}

/// A vector without structure, the same in every run.
fn start(n: usize, k: usize, d2: &[f64]) -> DVector<f64> {
    let mut state = 0x9e37_79b9_7f4a_7c15_u64.wrapping_mul(k as u64 + 1);
    DVector::from_fn(n, |i, _| {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5) / d2[i].sqrt()
    })
}

/// Gram–Schmidt in the metric D², twice for accuracy.
fn orthonormalize(vectors: &mut [DVector<f64>], d2: &[f64]) {
    let dot = |a: &DVector<f64>, b: &DVector<f64>| -> f64 { (0..d2.len()).map(|i| a[i] * d2[i] * b[i]).sum() };
    for k in 0..vectors.len() {
        let (done, rest) = vectors.split_at_mut(k);
        let v = &mut rest[0];
        for _ in 0..2 {
            let norm = dot(v, v).sqrt();
            *v /= norm;
            for b in done.iter() {
                let along = dot(b, v);
                v.axpy(-along, b, 1.0);
            }
        }
        let norm = dot(v, v).sqrt();
        *v /= norm;
    }
}
