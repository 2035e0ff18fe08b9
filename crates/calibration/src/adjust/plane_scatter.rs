//! How much the depth of whole frames scatters: a plane of each frame's own, beyond what its pose explains.

use depthcal_model::{Camera, Context};
use depthcal_statistics::chi_squared_tail;
use nalgebra::{DMatrix, Matrix3, SMatrix, SVector, Vector3};
use rayon::prelude::*;

use super::adjustment::Adjustment;
use super::frame_rows::FrameRows;
use crate::observe::noise::{DepthNoise, NoiseModel, PlaneScatter};
use crate::observe::{AdjustableFrame, Capture};

/// Fewest frames from which a scatter is estimated.
const FEWEST_FRAMES: usize = 6;
/// Probability by chance above which planes count as noise.
const LEVEL: f64 = 1e-3;
/// Rounds of the expectation–maximisation; it is within a per cent after some ten.
const ROUNDS: usize = 60;

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

/// A frame's own plane, in standard deviations of the noise of its pixels.
#[derive(Debug, Clone, Copy)]
pub struct OwnPlaneFit {
    /// Coefficients of (1, u, v), see [`plane_shapes`]; added to the predicted inverse depth.
    pub plane: Vector3<f64>,
    /// Its information, the pose left free: the inverse of its covariance.
    pub information: Matrix3<f64>,
    /// Mean square that a plane of coefficients of variance 1 has on average over the samples, times their number, over the
    /// number of coefficients.
    pub leverage: f64,
}

impl OwnPlaneFit {
    /// χ² statistic with three degrees of freedom.
    pub fn statistic(&self) -> f64 {
        self.plane.dot(&(self.information * self.plane))
    }
}

/// The plane of one frame, fitted together with its pose to its rows of an adjustment without planes. `shapes` has those of its samples. `None` where the markers leave the pose so free that nothing tells the plane from it.
pub fn own_plane(rows: &FrameRows, shapes: &[Vector3<f64>]) -> Option<OwnPlaneFit> {
    let first = rows.residuals.len() - rows.depth;
    let mut normal = SMatrix::<f64, 9, 9>::zeros();
    let mut rhs = SVector::<f64, 9>::zeros();
    for row in 0..rows.residuals.len() {
        let mut columns = SVector::<f64, 9>::zeros();
        for c in 0..6 {
            columns[c] = rows.pose[(row, c)];
        }
        if row >= first {
            // The residual is predicted minus measured: the plane adds to what is predicted.
            columns.fixed_rows_mut::<3>(6).copy_from(&(shapes.get(row - first)? * rows.weights[row]));
        }
        normal += columns * columns.transpose();
        rhs += columns * rows.residuals[row];
    }
    let step = -normal.cholesky()?.solve(&rhs);
    let covariance = normal.try_inverse()?;
    let information = covariance.fixed_view::<3, 3>(6, 6).into_owned().try_inverse()?;
    let leverage = shapes.iter().map(Vector3::norm_squared).sum::<f64>() / 3.0;
    Some(OwnPlaneFit { plane: step.fixed_rows::<3>(6).into_owned(), information, leverage })
}

/// The scatter of the frames' own planes at the optimum of an adjustment; none where noise explains the planes.
pub fn plane_scatter<F: AdjustableFrame>(capture: &Capture<F>, camera: &Camera, noise: &NoiseModel) -> PlaneScatter {
    let noise = NoiseModel { planes: PlaneScatter::NONE, ..*noise };
    let adjustment = Adjustment::new(capture, camera, &noise, true);
    let of_frame = |(index, frame): (usize, &F)| {
        if frame.samples().is_empty() || frame.posed().markers.is_empty() {
            return None;
        }
        let rows = adjustment.frame_rows(index)?;
        let samples: Vec<_> = frame.samples().iter().map(|s| (s.context, 1.0 / s.depth_mm)).collect();
        own_plane(&rows, &plane_shapes(camera, &samples, &noise.depth))
    };
    let planes: Vec<OwnPlaneFit> = capture.frames.par_iter().enumerate().filter_map(of_frame).collect();
    scatter_of(&planes)
}

/// The scatter that planes show beyond what noise makes of them.
fn scatter_of(planes: &[OwnPlaneFit]) -> PlaneScatter {
    let n = planes.len();
    let statistic: f64 = planes.iter().map(OwnPlaneFit::statistic).sum();
    if n < FEWEST_FRAMES || chi_squared_tail(statistic, 3 * n) > LEVEL {
        return PlaneScatter::NONE;
    }
    let variance = variances(planes, true).x;
    let leverage = planes.iter().map(|p| p.leverage).sum::<f64>() / n as f64;
    let deviations = variances(planes, false).map(f64::sqrt).into();
    PlaneScatter { of_noise: variance.sqrt(), deviations, design_effect: 1.0 + variance * leverage }
}

/// Maximum-likelihood estimate of the variances T of the coefficients from planes with the distribution N(0, T + C), C the inverse of each
/// information (Dempster, Laird, Rubin 1977); one for all three, where they are `alike`.
fn variances(planes: &[OwnPlaneFit], alike: bool) -> Vector3<f64> {
    // One degree of freedom of each coefficient goes into the camera's parameters, which the planes have been fitted with.
    let each = planes.len() as f64 - 1.0;
    let mut variances = Vector3::repeat(planes.iter().map(|p| p.plane.norm_squared()).sum::<f64>() / (3.0 * each));
    for _ in 0..ROUNDS {
        let mut next = Vector3::zeros();
        let prior = Matrix3::from_diagonal(&variances.map(f64::recip));
        for p in planes {
            let Some(posterior) = (p.information + prior).try_inverse() else { continue };
            let mean = posterior * (p.information * p.plane);
            next += mean.component_mul(&mean) + posterior.diagonal();
        }
        variances = if alike { Vector3::repeat(next.mean() / each) } else { next / each };
    }
    variances
}

/// The covariance of a camera's parameters (zero for held ones) where frames have planes of their own of the given scatter: to that of the
/// noise alone, `covariance`, what the planes add is added, C G T Gᵀ C for each frame, where G is how its planes turn the gradient and T
/// has their variances (the sandwich of a misspecified likelihood; White 1982).
pub fn covariance_with_planes<F: AdjustableFrame>(
    adjustment: &Adjustment,
    capture: &Capture<F>,
    camera: &Camera,
    noise: &DepthNoise,
    planes: &PlaneScatter,
    covariance: &DMatrix<f64>,
) -> DMatrix<f64> {
    if *planes == PlaneScatter::NONE {
        return covariance.clone();
    }
    let of_free = covariance.select_columns(&camera.free_parameters());
    let moves = |(index, frame): (usize, &F)| {
        let samples: Vec<_> = frame.samples().iter().map(|s| (s.context, 1.0 / s.depth_mm)).collect();
        let response = adjustment.plane_response(index, &plane_shapes(camera, &samples, noise))?;
        let moved = &of_free * response * Matrix3::from_diagonal(&Vector3::from(planes.deviations));
        Some(&moved * moved.transpose())
    };
    let added: Vec<DMatrix<f64>> = capture.frames.par_iter().enumerate().filter_map(moves).collect();
    added.into_iter().fold(covariance.clone(), |sum, frame| sum + frame)
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    fn planes(n: usize, of_noise: f64, seed: u64) -> Vec<OwnPlaneFit> {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let mut draw = || -> f64 { StandardNormal.sample(&mut rng) };
        let deviation = Vector3::new(0.2, 0.5, 0.4);
        let information = Matrix3::from_diagonal(&deviation.map(|d| 1.0 / (d * d)));
        (0..n)
            .map(|_| {
                let plane = Vector3::from_fn(|i, _| of_noise * draw() + deviation[i] * draw());
                OwnPlaneFit { plane, information, leverage: 100.0 }
            })
            .collect()
    }

    /// The standard deviation of τ from the 600 coefficients of 200 frames is 3 % where these are exact, more where they are not.
    #[test]
    fn the_scatter_of_planes_is_recovered() {
        for truth in [2.0, 0.5] {
            let found = scatter_of(&planes(200, truth, 3)).of_noise;
            assert!((found / truth - 1.0).abs() < 0.12, "{found} {truth}");
        }
    }

    #[test]
    fn planes_of_noise_are_no_scatter() {
        let found = (0..200).filter(|seed| scatter_of(&planes(30, 0.0, *seed)) != PlaneScatter::NONE).count();
        assert!(found <= 2, "{found} of 200 at a level of 0.1 %");
        assert_eq!(scatter_of(&planes(5, 9.0, 1)), PlaneScatter::NONE, "too few frames");
    }
}
