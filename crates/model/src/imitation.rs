//! A camera fitted to another one's rays: for start values, and for files that cannot hold a lens exactly.

use nalgebra::{DMatrix, DVector, Isometry3};

use crate::camera::Camera;
use crate::chain::{POSE, Workspace};

/// Depth of the points that stand for rays, mm.
const DEPTH_MM: f64 = 1000.0;
/// Weight of a parameter's typical size against a pixel: it decides only what the rays leave open.
const OF_SCALE: f64 = 1e-4;
/// Most steps of the Levenberg–Marquardt method.
const MOST_STEPS: usize = 100;
/// Relative decrease of the cost below which the fit ends.
const SETTLED: f64 = 1e-10;

impl Camera {
    /// This camera with the values of its free lens and pinhole parameters at which the rays (X/Z, Y/Z) come nearest to the
    /// pixels, in least squares (Levenberg 1944, Marquardt 1963). Parameters that the rays do not determine stay near their
    /// present values.
    pub fn fitted_to_rays(&self, rays: &[[f64; 2]], pixels: &[[f64; 2]]) -> Self {
        let chain = self.chain();
        let count = chain.image_parameter_count();
        let parameters: Vec<(bool, f64)> = self
            .blocks()
            .iter()
            .flat_map(|b| {
                // A pinhole's parameters are determined by any rays.
                let weight = |i: usize| if b.piece().is_some() { OF_SCALE / b.parameters()[i].scale } else { 0.0 };
                (0..b.theta.len()).map(move |i| (b.free[i], weight(i)))
            })
            .take(count)
            .collect();
        let free: Vec<usize> = (0..parameters.len()).filter(|i| parameters[*i].0).collect();
        let weights: Vec<f64> = free.iter().map(|i| parameters[*i].1).collect();
        let points: Vec<[f64; 2]> = rays.iter().map(|r| r.map(|c| c * DEPTH_MM)).collect();
        let start = self.theta();
        let cost = |r: &DVector<f64>, theta: &[f64]| {
            let penalty = free.iter().zip(&weights).map(|(i, w)| (w * (theta[*i] - start[*i])).powi(2));
            r.norm_squared() + penalty.sum::<f64>()
        };
        let (mut theta, mut lambda) = (start.clone(), 1e-3);
        let mut jacobian = DMatrix::zeros(2 * points.len(), free.len());
        for _ in 0..MOST_STEPS {
            let Some(r) = self.residuals(&theta, &points, pixels, Some((&mut jacobian, &free))) else { break };
            let now = cost(&r, &theta);
            let (mut normal, mut slope) = (jacobian.tr_mul(&jacobian), jacobian.tr_mul(&r));
            for (k, (i, w)) in free.iter().zip(&weights).enumerate() {
                normal[(k, k)] += w * w;
                slope[k] -= w * w * (theta[*i] - start[*i]);
            }
            let mut decrease = 0.0;
            while lambda < 1e12 {
                let mut damped = normal.clone();
                (0..free.len()).for_each(|k| damped[(k, k)] *= 1.0 + lambda);
                let Some(step) = damped.cholesky().map(|c| c.solve(&slope)) else { break };
                let mut next = theta.clone();
                free.iter().zip(step.iter()).for_each(|(i, s)| next[*i] += s);
                let trial = self.residuals(&next, &points, pixels, None).map_or(f64::INFINITY, |r| cost(&r, &next));
                if trial < now {
                    (theta, lambda, decrease) = (next, (lambda * 0.2).max(1e-14), now - trial);
                    break;
                }
                lambda *= 5.0;
            }
            if decrease <= SETTLED * now {
                break;
            }
        }
        self.with_theta(&theta)
    }

    /// Pixels less those of the points under `theta`, 2 per point; where asked for also the derivatives of the pixels by the
    /// parameters `free`, 2 rows per point. `None` where a pixel is not finite.
    fn residuals(
        &self,
        theta: &[f64],
        points: &[[f64; 2]],
        pixels: &[[f64; 2]],
        jacobian: Option<(&mut DMatrix<f64>, &[usize])>,
    ) -> Option<DVector<f64>> {
        let chain = self.chain();
        let facing = Isometry3::translation(0.0, 0.0, DEPTH_MM);
        let columns = POSE + chain.image_parameter_count();
        let mut projected = vec![[0.0; 2]; points.len()];
        let mut rows = vec![0.0; if jacobian.is_some() { 2 * points.len() * columns } else { 0 }];
        let wanted = jacobian.is_some().then_some(rows.as_mut_slice());
        chain.image(&mut Workspace::default(), theta, &facing, points, &mut projected, wanted).ok()?;
        if let Some((jacobian, free)) = jacobian {
            for (r, row) in rows.chunks_exact(columns).enumerate() {
                free.iter().enumerate().for_each(|(k, i)| jacobian[(r, k)] = row[POSE + i]);
            }
        }
        let all =
            pixels.as_flattened().iter().zip(projected.as_flattened()).map(|(given, projected)| given - projected);
        let all = DVector::from_iterator(2 * points.len(), all);
        all.iter().all(|r| r.is_finite()).then_some(all)
    }

    /// Pixels on a regular grid over the image, its border among them, and their rays (X/Z, Y/Z) at a depth of a metre; pixels
    /// without a ray are left out.
    pub fn rays_over_image(&self, columns: usize, rows: usize) -> (Vec<[f64; 2]>, Vec<[f64; 2]>) {
        let coordinate = |i: usize, n: usize, size: usize| (size as f64 - 1.0) * i as f64 / (n.max(2) - 1) as f64;
        let pixels = (0..rows).flat_map(|j| {
            (0..columns).map(move |i| [coordinate(i, columns, self.width), coordinate(j, rows, self.height)])
        });
        pixels.filter_map(|p| Some((self.ray(p, 1.0 / DEPTH_MM).ok()?, p))).unzip()
    }
}
