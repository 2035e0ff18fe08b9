//! Whitening of depth residuals whose frames share planes of their own.
//!
//! With the planes a ~ N(0, τ²) of a frame, in standard deviations of its pixels, the whitened residuals of its samples have the
//! covariance I + τ² S Sᵀ, where the rows of S are (1, u, v). Multiplied by (I + τ² S Sᵀ)^(−½) they are independent again: a
//! frame with many pixels then says no more of what all its pixels share than its plane's scatter allows (generalised
//! least squares with random effects; Searle, Casella, McCulloch 1992).

use depthcal_model::{Camera, Context};
use nalgebra::{Matrix3, Vector3};

use crate::observe::noise::{DepthNoise, PlaneScatter};

/// Shapes of a frame's own plane at its samples: (1, u, v) in the mean standard deviation of the samples, over each sample's own. u
/// and v are its undistorted coordinates, about from −1 to 1 over the image.
///
/// So they are planes in inverse depth to the letter, as those of scenes and of D are. Were they bent, by the lens or by
/// noise that grows with depth, D could show what is left of its own plane as if it were none. NaN where the lens has no
/// inverse.
pub fn plane_shapes(camera: &Camera, samples: &[(Context, f64)], noise: &DepthNoise) -> Vec<Vector3<f64>> {
    let [fx, fy, ..] = camera.pinhole();
    let sigmas: Vec<f64> = samples.iter().map(|(_, rho)| noise.sigma(*rho)).collect();
    let mean = sigmas.iter().sum::<f64>() / sigmas.len().max(1) as f64;
    let shape = |((context, rho), sigma): (&(Context, f64), &f64)| {
        let ray = camera.ray(camera.image_pixel(context), *rho);
        let [x, y] = ray.unwrap_or([f64::NAN; 2]);
        Vector3::new(1.0, 2.0 * fx * x / camera.width as f64, 2.0 * fy * y / camera.height as f64) * (mean / sigma)
    };
    samples.iter().zip(&sigmas).map(shape).collect()
}

/// The factor (I + τ² S Sᵀ)^(−½) of one frame, as I − U diag(c) Uᵀ with three orthonormal columns U.
#[derive(Debug, Clone)]
pub struct PlaneWhitening {
    directions: Vec<Vector3<f64>>,
    shrink: Vector3<f64>,
}

impl PlaneWhitening {
    /// For samples of the given shapes; `None` where frames have no planes of their own, or where a shape is not finite.
    pub fn new(shapes: impl Iterator<Item = Vector3<f64>>, scatter: &PlaneScatter) -> Option<Self> {
        if scatter.of_noise == 0.0 {
            return None;
        }
        let scaled: Vec<Vector3<f64>> = shapes.map(|s| s * scatter.of_noise).collect();
        if scaled.iter().any(|s| !s.iter().all(|c| c.is_finite())) {
            return None;
        }
        let gram = scaled.iter().fold(Matrix3::zeros(), |sum, s| sum + s * s.transpose());
        let eigen = gram.symmetric_eigen();
        let mut rotation = eigen.eigenvectors;
        let mut shrink = Vector3::zeros();
        for i in 0..3 {
            let value = eigen.eigenvalues[i];
            let usable = value > 1e-12 * eigen.eigenvalues.amax();
            shrink[i] = if usable { 1.0 - 1.0 / (1.0 + value).sqrt() } else { 0.0 };
            rotation.column_mut(i).scale_mut(if usable { 1.0 / value.sqrt() } else { 0.0 });
        }
        Some(Self { directions: scaled.iter().map(|s| rotation.tr_mul(s)).collect(), shrink })
    }

    /// Multiplies rows of `columns` numbers each, one per sample, by the factor.
    pub fn apply(&self, rows: &mut [f64], columns: usize, sums: &mut Vec<f64>) {
        sums.clear();
        sums.resize(3 * columns, 0.0);
        for (row, u) in rows.chunks_exact(columns).zip(&self.directions) {
            for (i, sum) in sums.chunks_exact_mut(columns).enumerate() {
                sum.iter_mut().zip(row).for_each(|(s, r)| *s += u[i] * r);
            }
        }
        for (i, sum) in sums.chunks_exact_mut(columns).enumerate() {
            sum.iter_mut().for_each(|s| *s *= self.shrink[i]);
        }
        for (row, u) in rows.chunks_exact_mut(columns).zip(&self.directions) {
            for (i, sum) in sums.chunks_exact(columns).enumerate() {
                row.iter_mut().zip(sum).for_each(|(r, s)| *r -= u[i] * s);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;

    /// W (I + τ² S Sᵀ) Wᵀ = I.
    #[test]
    fn whitened_rows_are_independent() {
        let shapes: Vec<Vector3<f64>> = (0..12)
            .map(|i| Vector3::new(1.0, f64::from(i * 37 % 64) / 32.0 - 1.0, f64::from(i * 23 % 48) / 24.0 - 1.0))
            .collect();
        for of_noise in [3.0, 0.2] {
            let n = shapes.len();
            let whitening = PlaneWhitening::new(shapes.iter().copied(), &PlaneScatter { of_noise }).unwrap();
            let mut rows = DMatrix::<f64>::identity(n, n);
            whitening.apply(rows.as_mut_slice(), n, &mut Vec::new());
            let s = DMatrix::from_fn(n, 3, |k, i| shapes[k][i] * of_noise);
            let covariance = DMatrix::identity(n, n) + &s * s.transpose();
            let white = &rows * covariance * rows.transpose();
            assert!((white - DMatrix::identity(n, n)).amax() < 1e-12);
        }
        assert!(PlaneWhitening::new(shapes.into_iter(), &PlaneScatter::default()).is_none());
    }
}
