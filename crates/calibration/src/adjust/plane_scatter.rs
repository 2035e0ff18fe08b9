//! How much the depth of whole frames scatters: a plane of each frame's own, and a term in the inverse of the amplitude, beyond
//! what its pose explains.

use depthcal_model::{Camera, Context};
use depthcal_statistics::chi_squared_tail;
use nalgebra::{DMatrix, SMatrix, SVector, Vector3, Vector4};
use rayon::prelude::*;

use super::adjustment::Adjustment;
use super::frame_rows::FrameRows;
use super::problem::Problem;
use super::state::{CameraState, State};
use crate::observe::noise::{DepthNoise, NoiseModel, PlaneScatter};
use crate::observe::{AdjustableFrame, CameraFrames};

/// Fewest frames from which a scatter is estimated.
const FEWEST_FRAMES: usize = 6;
/// Probability by chance above which planes count as noise.
const LEVEL: f64 = 1e-3;
/// Least standard deviation of the inverse amplitude over its mean: of less there is nothing to tell from a plane.
const LEAST_AMPLITUDE_SCATTER: f64 = 0.1;
/// Rounds of the expectation–maximisation; it is within a per cent after some ten.
const ROUNDS: usize = 60;

/// Shapes of a frame's own plane at its samples: (1, u, v) in the mean standard deviation of the samples, over each sample's own.
/// u and v are its undistorted coordinates, about from −1 to 1 over the image.
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

/// The shapes of [`plane_shapes`], and as a fourth the inverse of the amplitude against that of all frames, without its mean over
/// the frame; zero where `typical_amplitude` is `None`. Light that goes astray adds to a pixel's phasor, so that dark pixels
/// suffer in proportion, and how much there is changes from frame to frame (Mure-Dubois, Hügli 2007).
fn shapes_with_amplitude(
    camera: &Camera,
    samples: &[(Context, f64)],
    noise: &DepthNoise,
    typical_amplitude: Option<f64>,
) -> Vec<Vector4<f64>> {
    let inverse = |context: &Context| typical_amplitude.map_or(0.0, |typical| typical / context.amplitude);
    let mean = samples.iter().map(|(context, _)| inverse(context)).sum::<f64>() / samples.len().max(1) as f64;
    let planes = plane_shapes(camera, samples, noise).into_iter().zip(samples);
    planes.map(|(plane, (context, _))| plane.push(plane.x * (inverse(context) - mean))).collect()
}

/// Harmonic mean of the amplitudes of all depth samples; `None` where one is unknown, or where they hardly differ.
fn typical_amplitude<F: AdjustableFrame>(capture: &CameraFrames<F>) -> Option<f64> {
    let amplitudes = || capture.frames.iter().flat_map(|f| f.samples()).map(|s| s.context.amplitude);
    if amplitudes().next().is_none() || amplitudes().any(|a| !(a > 0.0 && a.is_finite())) {
        return None;
    }
    let (sum, squares, n) =
        amplitudes().map(f64::recip).fold((0.0, 0.0, 0.0), |(s, q, n), x| (s + x, q + x * x, n + 1.0));
    let mean = sum / n;
    let scatter = (squares / n - mean * mean).max(0.0).sqrt() / mean;
    (scatter > LEAST_AMPLITUDE_SCATTER).then(|| mean.recip())
}

/// A frame's own plane, or its plane and a further shape, in standard deviations of the noise of its pixels.
#[derive(Debug, Clone, Copy)]
pub struct OwnPlaneFit<const N: usize> {
    /// Coefficients of the shapes, of which (1, u, v) are the first, see [`plane_shapes`]; added to the predicted inverse depth.
    pub plane: SVector<f64, N>,
    /// Their information, the pose left free: the inverse of their covariance.
    pub information: SMatrix<f64, N, N>,
    /// Mean square that shapes of coefficients of variance 1 have on average over the samples, times their number, over the
    /// number of coefficients.
    pub leverage: f64,
}

impl<const N: usize> OwnPlaneFit<N> {
    /// χ² statistic with as many degrees of freedom as coefficients.
    pub fn statistic(&self) -> f64 {
        self.plane.dot(&(self.information * self.plane))
    }
}

/// The plane of one frame, fitted together with its pose to its rows of an adjustment without planes. `shapes` has those of its
/// samples. `None` where the markers leave the pose so free that nothing tells the plane from it.
pub fn own_plane<const N: usize>(rows: &FrameRows, shapes: &[SVector<f64, N>]) -> Option<OwnPlaneFit<N>> {
    let (count, pose) = (rows.residuals.len(), rows.pose.ncols());
    let first = count - rows.depth;
    if shapes.len() < rows.depth {
        return None;
    }
    // The residual is predicted minus measured: the plane adds to what is predicted.
    let columns = DMatrix::from_fn(count, pose + N, |row, c| match (c < pose, row >= first) {
        (true, _) => rows.pose[(row, c)],
        (false, true) => shapes[row - first][c - pose] * rows.weights[row],
        (false, false) => 0.0,
    });
    let normal = columns.tr_mul(&columns);
    let step = -normal.clone().cholesky()?.solve(&columns.tr_mul(&rows.residuals));
    let covariance = normal.try_inverse()?;
    let information = covariance.fixed_view::<N, N>(pose, pose).into_owned().try_inverse()?;
    let leverage = shapes.iter().map(SVector::norm_squared).sum::<f64>() / N as f64;
    Some(OwnPlaneFit { plane: step.fixed_rows::<N>(pose).into_owned(), information, leverage })
}

/// The scatter of the planes of a camera's frames at the optimum of an adjustment, whose residuals have the given noise, a noise
/// model per camera; none where noise explains the planes.
pub fn plane_scatter<F: AdjustableFrame>(state: &State<F>, number: usize, noises: &[NoiseModel]) -> PlaneScatter {
    let mut problem = Problem::of_state(state, true);
    let noises: Vec<_> = noises.iter().map(|noise| NoiseModel { planes: PlaneScatter::NONE, ..*noise }).collect();
    for (camera, noise) in problem.cameras.iter_mut().zip(&noises) {
        camera.noise = noise;
    }
    let adjustment = Adjustment::of_problem(&problem);
    let (capture, camera, noise) = (&state.cameras[number].capture, &state.cameras[number].camera, &noises[number]);
    let amplitude = typical_amplitude(capture);
    let in_rig = &state.cameras[number].frames;
    let seen: Vec<bool> = state.frames_with_markers();
    let of_frame = |(index, frame): (usize, &F)| {
        if frame.samples().is_empty() || !seen[in_rig[index]] {
            return None;
        }
        let rows = adjustment.frame_rows(number, in_rig[index])?;
        let samples: Vec<_> = frame.samples().iter().map(|s| (s.context, 1.0 / s.depth_mm)).collect();
        let shapes = shapes_with_amplitude(camera, &samples, &noise.depth, amplitude);
        let planes: Vec<Vector3<f64>> = shapes.iter().map(|s| s.xyz()).collect();
        let plane = own_plane(&rows, &planes)?;
        Some((plane, amplitude.and_then(|_| own_plane(&rows, &shapes))))
    };
    let (planes, with_amplitude): (Vec<OwnPlaneFit<3>>, Vec<Option<OwnPlaneFit<4>>>) =
        capture.frames.par_iter().enumerate().filter_map(of_frame).collect::<Vec<_>>().into_iter().unzip();
    scatter_of(&planes, &with_amplitude.into_iter().flatten().collect::<Vec<_>>())
}

/// The scatter of the frames' planes in excess of what noise explains. Where `with_amplitude` has fits of planes together with a
/// term in the inverse amplitude, the scatter of each coefficient comes from those.
fn scatter_of(planes: &[OwnPlaneFit<3>], with_amplitude: &[OwnPlaneFit<4>]) -> PlaneScatter {
    let n = planes.len();
    let statistic: f64 = planes.iter().map(OwnPlaneFit::statistic).sum();
    if n < FEWEST_FRAMES || chi_squared_tail(statistic, 3 * n) > LEVEL {
        return PlaneScatter::NONE;
    }
    let variance = variances(planes, true).x;
    let leverage = planes.iter().map(|p| p.leverage).sum::<f64>() / n as f64;
    let deviations = match with_amplitude.len() < FEWEST_FRAMES {
        true => variances(planes, false).push(0.0),
        false => variances(with_amplitude, false),
    };
    let deviations = deviations.map(f64::sqrt).into();
    PlaneScatter { of_noise: variance.sqrt(), deviations, design_effect: 1.0 + variance * leverage }
}

/// Maximum-likelihood estimate of the variances T of the coefficients from planes with the distribution N(0, T + C), C the
/// inverse of each information (Dempster, Laird, Rubin 1977); one for all, where they are `alike`.
fn variances<const N: usize>(planes: &[OwnPlaneFit<N>], alike: bool) -> SVector<f64, N> {
    // One degree of freedom of each coefficient goes into the camera's parameters, which the planes have been fitted with.
    let each = planes.len() as f64 - 1.0;
    let mean_square = planes.iter().map(|p| p.plane.norm_squared()).sum::<f64>() / (N as f64 * each);
    let mut variances = SVector::<f64, N>::repeat(mean_square);
    for _ in 0..ROUNDS {
        let mut next = SVector::<f64, N>::zeros();
        let prior = SMatrix::<f64, N, N>::from_diagonal(&variances.map(f64::recip));
        for p in planes {
            let Some(posterior) = (p.information + prior).try_inverse() else { continue };
            let mean = posterior * (p.information * p.plane);
            next += mean.component_mul(&mean) + posterior.diagonal();
        }
        variances = if alike { SVector::repeat(next.mean() / each) } else { next / each };
    }
    variances
}

/// The covariance of all cameras' parameters, in the order of [`Adjustment::variables`] (zero for held ones), where frames of a
/// camera have planes of their own of the given scatter: to that of the noise alone, `covariance`, what the planes add is added,
/// C G T Gᵀ C for each frame, where G is how its planes turn the gradient and T has their variances (the sandwich of a
/// misspecified likelihood; White 1982).
pub fn covariance_with_planes<F: AdjustableFrame>(
    adjustment: &Adjustment,
    (state, number): (&State<F>, usize),
    noise: &DepthNoise,
    planes: &PlaneScatter,
    covariance: &DMatrix<f64>,
) -> DMatrix<f64> {
    if *planes == PlaneScatter::NONE {
        return covariance.clone();
    }
    let CameraState { capture, camera, frames, .. } = &state.cameras[number];
    let of_free = covariance.select_columns(&adjustment.free_rows());
    let amplitude = typical_amplitude(capture);
    let moves = |(index, frame): (usize, &F)| {
        let samples: Vec<_> = frame.samples().iter().map(|s| (s.context, 1.0 / s.depth_mm)).collect();
        let shapes = shapes_with_amplitude(camera, &samples, noise, amplitude);
        let response = adjustment.plane_response(number, frames[index], &shapes)?;
        let moved = &of_free * response * SMatrix::<f64, 4, 4>::from_diagonal(&Vector4::from(planes.deviations));
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

    fn planes(n: usize, of_noise: f64, seed: u64) -> Vec<OwnPlaneFit<3>> {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let mut draw = || -> f64 { StandardNormal.sample(&mut rng) };
        let deviation = Vector3::new(0.2, 0.5, 0.4);
        let information = SMatrix::<f64, 3, 3>::from_diagonal(&deviation.map(|d| 1.0 / (d * d)));
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
            let scatter = scatter_of(&planes(200, truth, 3), &[]).of_noise;
            assert!((scatter / truth - 1.0).abs() < 0.12, "{scatter} {truth}");
        }
    }

    #[test]
    fn planes_of_noise_are_no_scatter() {
        let false_scatters =
            (0..200).filter(|seed| scatter_of(&planes(30, 0.0, *seed), &[]) != PlaneScatter::NONE).count();
        assert!(false_scatters <= 2, "{false_scatters} of 200 at a level of 0.1 %");
        assert_eq!(scatter_of(&planes(5, 9.0, 1), &[]), PlaneScatter::NONE, "too few frames");
    }
}
