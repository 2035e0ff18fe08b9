//! The error of a goal: a sum of squares of normal variables.

use depthcal_statistics::gamma_tail;
use nalgebra::DMatrix;

/// Probability with which a goal is to be met.
const CERTAINTY: f64 = 0.95;

/// The mean square Σ λ χ²₁ of a goal's error: its mean, and the traces that give its other moments.
pub(super) struct Error {
    /// Its mean.
    pub mean_square: f64,
    variance: f64,
    third: f64,
}

impl Error {
    /// For a covariance of the parameters and the weight of a goal.
    pub fn of(covariance: &DMatrix<f64>, weight: &DMatrix<f64>) -> Self {
        let product = covariance * weight;
        let square = &product * &product;
        let third = square.component_mul(&product.transpose()).sum();
        Self { mean_square: product.trace(), variance: 2.0 * square.trace(), third: 8.0 * third }
    }

    /// The mean alone: trace(C W) of symmetric matrices.
    pub fn mean_square_of(covariance: &DMatrix<f64>, weight: &DMatrix<f64>) -> f64 {
        covariance.dot(weight)
    }

    /// The value that the root of the mean square is below with a probability of [`CERTAINTY`].
    pub fn certain(&self) -> f64 {
        let deviation = self.variance.sqrt();
        let skewness = self.third / self.variance.powf(1.5);
        let (mut low, mut high) = (-10.0, 20.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if gamma_tail(middle, skewness) > 1.0 - CERTAINTY { low = middle } else { high = middle }
        }
        (self.mean_square + high * deviation).max(0.0).sqrt()
    }
}
