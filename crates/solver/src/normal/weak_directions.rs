//! Directions along which H is weak: inverse iteration, the Rayleigh–Ritz method, and the smallest pivot.

use faer::{Mat, Side};
use nalgebra::{DMatrix, DVector};

use crate::normal::linear::Linear;
use crate::normal::normal_equations::NormalEquations;
use crate::normal::qr::multiply_rows;
use crate::normal::reduced_system::ReducedSystem;
use crate::normal::selected_inverse::SelectedInverse;

impl NormalEquations {
    /// Factorises H + μ D² for [`solve_many`](Self::solve_many); false if it is not positive definite.
    #[must_use]
    pub fn factorize(&mut self, mu: f64, d2: &[f64]) -> bool {
        self.eliminate(mu, d2)
    }

    /// Solves in place for several right-hand sides, one after the other in `rhs`, with the last factorisation. Nothing
    /// may be eliminated.
    pub fn solve_many(&mut self, rhs: &mut [f64]) {
        if let Linear::Direct(reduced) = &mut self.linear {
            reduced.solve_many(rhs);
        }
    }

    /// Entries of the inverse of the matrix that was factorised last, where the factor has entries. `None` without a sparse
    /// factor. Nothing may be eliminated.
    pub fn selected_inverse(&self) -> Option<SelectedInverse> {
        match &self.linear {
            Linear::Direct(ReducedSystem::Sparse(sparse)) => Some(SelectedInverse::new(sparse)),
            _ => None,
        }
    }

    /// Inverse iteration of several vectors, one after the other in `vectors`: x ← (H + μ D²)⁻¹ D² x; false if one is not
    /// finite. Nothing may be eliminated, and [`factorize`](Self::factorize) must have been called with the same μ and
    /// D².
    #[must_use]
    pub fn inverse_iteration(&mut self, mu: f64, d2: &[f64], vectors: &mut [f64]) -> bool {
        if let Linear::Orthogonal(qr) = &mut self.linear {
            return vectors.chunks_exact_mut(d2.len()).all(|x| qr.inverse_iteration(&self.chunks, mu, d2, x));
        }
        for x in vectors.chunks_exact_mut(d2.len()) {
            x.iter_mut().zip(d2).for_each(|(x, d2)| *x *= d2);
        }
        self.solve_many(vectors);
        vectors.iter().all(|x| x.is_finite())
    }

    /// The Rayleigh–Ritz method on the columns of V: the eigenvalues of Vᵀ H V, ascending, and its eigenvectors as
    /// columns. `None` if they are not found. Nothing may be eliminated.
    pub fn ritz(&self, vectors: &[DVector<f64>]) -> Option<(Vec<f64>, DMatrix<f64>)> {
        let k = vectors.len();
        if matches!(self.linear, Linear::Orthogonal(_)) {
            // As squares of the singular values of J V, small eigenvalues do not suffer from rounding errors of large ones.
            let products: Vec<Vec<f64>> = vectors.iter().map(|v| multiply_rows(&self.chunks, v.as_slice())).collect();
            let rows = products.first().map_or(0, Vec::len).max(k);
            let image = Mat::from_fn(rows, k, |i, j| products[j].get(i).copied().unwrap_or(0.0));
            let svd = image.thin_svd().ok()?;
            let values = (0..k).rev().map(|i| svd.S()[i] * svd.S()[i]).collect();
            return Some((values, DMatrix::from_fn(k, k, |i, j| svd.V()[(i, k - 1 - j)])));
        }
        let multiply = |v: &DVector<f64>| {
            let mut product = DVector::zeros(v.len());
            self.blocks.multiply(v.as_slice(), product.as_mut_slice());
            product
        };
        let products: Vec<DVector<f64>> = vectors.iter().map(multiply).collect();
        let eigen = Mat::from_fn(k, k, |i, j| vectors[i].dot(&products[j])).self_adjoint_eigen(Side::Lower).ok()?;
        let values = (0..k).map(|i| eigen.S()[i].max(0.0)).collect();
        Some((values, DMatrix::from_fn(k, k, |i, j| eigen.U()[(i, j)])))
    }

    /// The component with the smallest pivot, relative to D², of the last factorisation of H + μ D², and that relative
    /// pivot. `None` with conjugate gradients and QR, which have no pivots.
    pub fn weakest(&self, d2: &[f64]) -> Option<(usize, f64)> {
        let Linear::Direct(reduced) = &self.linear else { return None };
        let mut weakest: Option<(usize, f64)> = None;
        let mut compare = |i: usize, pivot: f64| {
            let relative = pivot / d2[i];
            let constrained = self.constrained.get(i).copied().unwrap_or(false);
            if !constrained && relative.is_finite() && weakest.is_none_or(|w| relative < w.1) {
                weakest = Some((i, relative));
            }
        };
        for chunk in &self.chunks {
            for e in &chunk.plan.eliminations {
                let d = e.d as usize;
                (0..d).for_each(|i| compare(chunk.plan.offset + e.e + i, chunk.lee[e.ee + i * d + i].powi(2)));
            }
        }
        reduced.for_each_pivot(|i, pivot| compare(self.layout.eliminated_dim + i, pivot));
        weakest
    }
}
