//! Gaussian noise models, which whiten residuals.

use nalgebra::{Cholesky, SMatrix, SVector};
use thiserror::Error;

use crate::problem::lane::Lane;

/// The parameters given do not define a noise model.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum NoiseError {
    /// A standard deviation is not a positive number.
    #[error("standard deviation {component} is {sigma}, not a positive number")]
    Sigma {
        /// Component of the residual or of the tangent space.
        component: usize,
        /// Its value.
        sigma: f64,
    },
    /// A covariance matrix is not symmetric and positive definite.
    #[error("the covariance matrix is not symmetric and positive definite")]
    NotPositiveDefinite,
    /// A square-root information matrix has a component that is not a finite number.
    #[error("the square-root information matrix is not finite")]
    NotFinite,
}

/// Gaussian noise of a residual of dimension M with covariance Σ. A residual e is whitened to r = A e with AᵀA = Σ⁻¹.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Noise<const M: usize>(Whitening<M>);

#[derive(Clone, Debug, Default, PartialEq)]
enum Whitening<const M: usize> {
    #[default]
    Unit,
    Diagonal(SVector<f64, M>),
    Full(SMatrix<f64, M, M>),
}

impl<const M: usize> Noise<M> {
    /// Σ = I: the residual is already whitened.
    pub fn unit() -> Self {
        Self(Whitening::Unit)
    }

    /// Σ = σ² I.
    ///
    /// # Errors
    /// If σ is not a positive number.
    pub fn isotropic(sigma: f64) -> Result<Self, NoiseError> {
        Self::diagonal([sigma; M])
    }

    /// Σ = diag(σᵢ²). A component with infinite σ has no influence.
    ///
    /// # Errors
    /// If a σ is not a positive number.
    pub fn diagonal(sigmas: [f64; M]) -> Result<Self, NoiseError> {
        match sigmas.iter().position(|s| s.is_nan() || *s <= 0.0) {
            Some(component) => Err(NoiseError::Sigma { component, sigma: sigmas[component] }),
            None => Ok(Self(Whitening::Diagonal(SVector::from(sigmas).map(|s| 1.0 / s)))),
        }
    }

    /// Full covariance Σ, M × M.
    ///
    /// # Errors
    /// If Σ is not symmetric and positive definite.
    pub fn covariance(covariance: SMatrix<f64, M, M>) -> Result<Self, NoiseError> {
        let asymmetry = (covariance - covariance.transpose()).amax();
        if asymmetry.is_nan() || asymmetry > 1e-9 * covariance.amax() {
            return Err(NoiseError::NotPositiveDefinite);
        }
        let lower = Cholesky::new(covariance).ok_or(NoiseError::NotPositiveDefinite)?.l();
        // Σ = L Lᵀ, so A = L⁻¹.
        let whitening =
            lower.solve_lower_triangular(&SMatrix::<f64, M, M>::identity()).ok_or(NoiseError::NotPositiveDefinite)?;
        Ok(Self(Whitening::Full(whitening)))
    }

    /// Full square-root information A, M × M, with AᵀA = Σ⁻¹. It may be singular.
    ///
    /// # Errors
    /// If A has a component that is not finite.
    pub fn square_root_information(a: SMatrix<f64, M, M>) -> Result<Self, NoiseError> {
        if a.iter().all(|v| v.is_finite()) { Ok(Self(Whitening::Full(a))) } else { Err(NoiseError::NotFinite) }
    }

    /// The whitened residual A e.
    #[inline(always)]
    pub fn whiten(&self, e: SVector<f64, M>) -> SVector<f64, M> {
        match &self.0 {
            Whitening::Unit => e,
            Whitening::Diagonal(w) => e.component_mul(w),
            Whitening::Full(a) => a * e,
        }
    }

    /// Whitens a Jacobian in place, J ← A J; `jacobian` is row-major, M × `columns`.
    #[inline(always)]
    pub fn whiten_rows(&self, jacobian: &mut [f64], columns: usize) {
        match &self.0 {
            Whitening::Unit => {}
            Whitening::Diagonal(w) => {
                for (row, w) in jacobian.chunks_exact_mut(columns.max(1)).zip(w.iter()) {
                    row.iter_mut().for_each(|j| *j *= w);
                }
            }
            Whitening::Full(a) => {
                for c in 0..columns {
                    let whitened = a * SVector::<f64, M>::from_fn(|r, _| jacobian[r * columns + c]);
                    for r in 0..M {
                        jacobian[r * columns + c] = whitened[r];
                    }
                }
            }
        }
    }

    /// Whitens M rows of residuals or of their Jacobians in place, of which the first lanes are `used`; `rows` is row-major.
    #[inline(always)]
    pub(crate) fn whiten_lanes(&self, rows: &mut [Lane], used: usize) {
        let columns = rows.len() / M.max(1);
        match &self.0 {
            Whitening::Unit => {}
            Whitening::Diagonal(w) => {
                for (row, w) in rows.chunks_exact_mut(columns.max(1)).zip(w.iter()) {
                    for lane in row {
                        lane[..used].iter_mut().for_each(|x| *x *= w);
                    }
                }
            }
            Whitening::Full(a) => {
                for c in 0..columns {
                    for l in 0..used {
                        let whitened = a * SVector::<f64, M>::from_fn(|r, _| rows[r * columns + c][l]);
                        for r in 0..M {
                            rows[r * columns + c][l] = whitened[r];
                        }
                    }
                }
            }
        }
    }
}
