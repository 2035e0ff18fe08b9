//! From captures to a calibrated depth camera.

use depthcal_model::{Block, Camera, CameraError, Register, RegisterError};
use depthcal_solver::{CovarianceError, SolveError};
use nalgebra::{DMatrix, Isometry3};
use rayon::prelude::*;
use thiserror::Error;
use tracing::{info, warn};

use crate::adjustment::{Adjusted, Adjustment};
use crate::board_region::BoardPlane;
use crate::depth_sampling::sample_depth;
use crate::estimators::{self, EstimatorError};
use crate::noise::{DepthNoise, NoiseModel, clipped_sigma};
use crate::observations::{Capture, DroppedFrame};
use crate::start::{FEWEST_FRAMES, FEWEST_MARKERS, FrameMarkers, StartError, estimate_pose, refine_pose, start_values};

/// How the depth model is estimated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Estimator {
    /// Everything in one adjustment.
    #[default]
    Joint,
    /// D by linear least squares, camera and poses from the images (thesis eq. 4.14).
    Linear,
    /// D by iteratively reweighted least squares (4.16, 4.17).
    Irls,
    /// D by minimising distances in space (4.18).
    Nonlinear,
}

impl Estimator {
    /// Name on the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Estimator::Joint => "joint",
            Estimator::Linear => "linear",
            Estimator::Irls => "irls",
            Estimator::Nonlinear => "nonlinear",
        }
    }
}

/// What to fit, and how.
#[derive(Debug, Clone)]
pub struct CalibrateOptions {
    /// Depth model: `none`, `projective`, `projective:xw`, `projective+…`.
    pub model: String,
    /// Further effects by name, at whatever hook they act.
    pub effects: Vec<String>,
    /// Lens model: `brown-conrady` or `none`.
    pub lens: String,
    /// How the depth model is estimated.
    pub estimator: Estimator,
    /// Most depth pixels of a frame that enter the adjustment.
    pub samples_per_frame: usize,
    /// A camera to start from, or, where its parameters are held, to keep.
    pub camera: Option<Camera>,
    /// The pieces that names may mean.
    pub register: Register,
}

impl Default for CalibrateOptions {
    fn default() -> Self {
        Self {
            model: "projective".to_owned(),
            effects: Vec::new(),
            lens: "brown-conrady".to_owned(),
            estimator: Estimator::Joint,
            samples_per_frame: 800,
            camera: None,
            register: Register::builtin(),
        }
    }
}

/// Why there is no calibration.
#[derive(Debug, Error)]
pub enum CalibrateError {
    /// No start values.
    #[error(transparent)]
    Start(#[from] StartError),
    /// A model's name is wrong.
    #[error(transparent)]
    Register(#[from] RegisterError),
    /// The solver failed.
    #[error("the adjustment failed: {0}")]
    Solve(#[from] SolveError),
    /// It stopped before it had converged.
    #[error("the adjustment did not converge ({reason}); its result cannot be trusted")]
    NotConverged {
        /// The solver's words.
        reason: String,
    },
    /// The data leave parameters undetermined.
    #[error("the captures do not determine the model: {0}")]
    Undetermined(#[from] CovarianceError),
    /// An estimator of D failed.
    #[error(transparent)]
    Estimator(#[from] EstimatorError),
    /// A depth model was asked for, but there is no depth.
    #[error(
        "the dataset '{dataset}' has no depth images, so the depth model '{model}' cannot be fitted: add depth to \
         dataset.toml or use --model none"
    )]
    NoDepth {
        /// The dataset.
        dataset: String,
        /// The model asked for.
        model: String,
    },
    /// No valid depth on the board.
    #[error(
        "no valid depth pixel lies on the board in any frame of '{dataset}': check depth.unit_mm and that depth and \
             image share one pixel grid"
    )]
    NoDepthOnBoard {
        /// The dataset.
        dataset: String,
    },
    /// The fitted camera cannot be inverted where it was fitted.
    #[error("the fitted model folds: {0}")]
    Folded(#[from] CameraError),
}

impl CalibrateError {
    /// Whether the fit itself cannot be trusted (rather than the input being at fault).
    pub fn is_untrusted_fit(&self) -> bool {
        matches!(self, Self::Solve(_) | Self::NotConverged { .. } | Self::Undetermined(_) | Self::Folded(_))
    }
}

/// A calibrated camera with everything that is known about the fit.
#[derive(Debug, Clone)]
pub struct Calibrated {
    /// The camera.
    pub camera: Camera,
    /// What was fitted, with the depth samples that were used; frames that turned out unusable are among its dropped.
    pub capture: Capture,
    /// Camera from board, per frame of `capture`.
    pub poses: Vec<Isometry3<f64>>,
    /// Joint covariance of [`Camera::theta`]; zero for held parameters. `None` from the estimators that give none.
    pub covariance: Option<DMatrix<f64>>,
    /// Noise, from the residuals.
    pub noise: NoiseModel,
    /// Whether depth took part.
    pub with_depth: bool,
    /// Distance at which the noise of depth pixels is uncorrelated, px.
    pub correlation_length_px: Option<usize>,
    /// Depth samples that were left out as outliers.
    pub outliers: usize,
    /// Reprojection error: root mean square distance, px.
    pub reprojection_rms_px: f64,
    /// Root mean square of the depth residuals at the samples, mm.
    pub depth_rms_mm: Option<f64>,
    /// Final cost, iterations and the solver's words.
    pub cost: f64,
    /// Iterations of the last adjustment.
    pub iterations: usize,
    /// Why it stopped.
    pub termination: String,
    /// The options' names, for the record.
    pub estimator: Estimator,
    /// Depth model and effects as asked for.
    pub model: String,
}

impl Calibrated {
    /// Standard deviation of every parameter in the order of [`Camera::theta`]; `None` for held ones.
    pub fn std_devs(&self) -> Vec<Option<f64>> {
        let free = self.camera.blocks().iter().flat_map(|b| b.free.iter().copied());
        free.enumerate()
            .map(|(i, free)| {
                let variance = self.covariance.as_ref().map(|c| c[(i, i)])?;
                (free && variance > 0.0).then(|| variance.sqrt())
            })
            .collect()
    }
}

/// Frames whose reprojection error exceeds this many times the median are misdetected boards.
const BAD_FRAME_RATIO: f64 = 6.0;
/// … but never those below this error, px.
const BAD_FRAME_FLOOR_PX: f64 = 0.5;
/// Depth samples beyond this many standard deviations are outliers.
const OUTLIER: f64 = 8.0;
/// Rounds of adjustment and noise estimation.
const ROUNDS: usize = 4;
/// Change of a standard deviation that ends the rounds.
const NOISE_SETTLED: f64 = 0.01;

/// Adjusts camera, lens and poses to the markers alone, from start values that are found here; drops misdetected frames.
///
/// # Errors
///
/// [`CalibrateError`], where the captures do not determine the camera.
pub fn calibrate_image(capture: &Capture, options: &CalibrateOptions) -> Result<Calibrated, CalibrateError> {
    let mut capture = capture.clone();
    capture.frames.retain(|frame| {
        let enough = frame.markers.len() >= FEWEST_MARKERS;
        if !enough {
            let reason = format!("only {} markers", frame.markers.len());
            capture.dropped.push(DroppedFrame { name: frame.name.clone(), reason });
        }
        enough
    });
    let lens = options.lens.replace('-', "_");
    let markers: Vec<FrameMarkers<'_>> =
        capture.frames.iter().map(|f| FrameMarkers { name: &f.name, markers: &f.markers }).collect();
    let (mut camera, mut poses) = match &options.camera {
        Some(camera) => {
            let poses = markers.iter().map(|m| estimate_pose(camera, &capture.target, m).map(|p| p.camera_from_board));
            (camera.clone(), poses.collect::<Result<Vec<_>, _>>()?)
        }
        None => start_values(&capture.target, capture.width, capture.height, &markers, &lens, &options.register)?,
    };
    for name in &options.effects {
        let block = options.register.block(name, None)?;
        if !crate::adjustment::is_depth_only(&block) {
            camera = camera.with_block(block);
        }
    }
    let mut noise = NoiseModel { pixel_sigma: 0.3, depth: DepthNoise { a_per_mm: 1e-5, b_mm: 0.0 } };
    let mut round = 0;
    loop {
        round += 1;
        let mut adjustment = Adjustment::new(&capture, &camera, &poses, &noise, false);
        let adjusted = adjustment.solve()?;
        (camera, poses) = (adjusted.camera.clone(), adjusted.poses.clone());
        if let Some(bad) = worst_frame(&capture, &adjusted.image_residuals, noise.pixel_sigma) {
            let frame = capture.frames.remove(bad.0);
            poses.remove(bad.0);
            warn!("frame {} is dropped: {}", frame.name, bad.1);
            capture.dropped.push(DroppedFrame { name: frame.name, reason: bad.1 });
            if capture.frames.len() < FEWEST_FRAMES {
                let found = capture.frames.len();
                return Err(StartError::TooFewFrames { found, needed: FEWEST_FRAMES }.into());
            }
            continue;
        }
        if round <= ROUNDS && leave_mirrored_poses(&capture, &camera, &mut poses) > 0 {
            continue;
        }
        let before = noise.pixel_sigma;
        let covariance = adjustment.covariance()?;
        let redundancy = adjustment.redundancies(&covariance).0;
        let n = adjusted.image_residuals.len() as f64;
        noise.pixel_sigma *= clipped_sigma(&adjusted.image_residuals) * (n / redundancy.max(1.0)).sqrt();
        let settled = (noise.pixel_sigma / before - 1.0).abs() < NOISE_SETTLED;
        if settled || round > 2 * ROUNDS {
            converged(&adjusted)?;
            let covariance = adjustment.camera_covariance(&covariance);
            return Ok(finish(capture, adjusted, noise, before, Some(covariance), None, options));
        }
    }
}

/// Calibrates a depth camera: markers first, then depth by the estimator asked for.
///
/// # Errors
///
/// [`CalibrateError`]; see [`CalibrateError::is_untrusted_fit`] for which of them speak of the fit.
pub fn calibrate(capture: &Capture, options: &CalibrateOptions) -> Result<Calibrated, CalibrateError> {
    let mut depth_blocks = options.register.depth_model(&options.model)?;
    for name in &options.effects {
        let block = options.register.block(name, None)?;
        if crate::adjustment::is_depth_only(&block) {
            depth_blocks.push(block);
        }
    }
    let from_image = calibrate_image(capture, options)?;
    info!(
        "{} frames, {:.3} px rms from the image alone",
        from_image.capture.frames.len(),
        from_image.reprojection_rms_px
    );
    if !capture.has_depth() {
        if options.model == "none" && depth_blocks.is_empty() {
            return Ok(from_image);
        }
        let (dataset, model) = (capture.name.clone(), options.model.clone());
        return Err(CalibrateError::NoDepth { dataset, model });
    }
    match options.estimator {
        Estimator::Joint => joint(from_image, depth_blocks, options),
        other => Ok(estimators::estimate(from_image, depth_blocks, other)?),
    }
}

fn joint(
    from_image: Calibrated,
    depth_blocks: Vec<Block>,
    options: &CalibrateOptions,
) -> Result<Calibrated, CalibrateError> {
    let mut capture = from_image.capture.clone();
    let mut correlation = None;
    if capture.frames.iter().any(|f| f.depth.is_some()) {
        let sampling = sample_depth(&mut capture, &from_image.camera, &from_image.poses, options.samples_per_frame);
        correlation = Some(sampling.correlation_length_px);
    }
    seed_samples(&mut capture, &from_image);
    if capture.frames.iter().all(|f| f.samples.is_empty()) {
        return Err(CalibrateError::NoDepthOnBoard { dataset: capture.name });
    }
    let mut camera = from_image.camera.clone();
    for block in depth_blocks {
        camera = camera.with_block(block);
    }
    let mut poses = from_image.poses.clone();
    let mut noise = NoiseModel { depth: depth_noise_from_planes(&capture), ..from_image.noise };
    let mut outliers = 0;
    let mut round = 0;
    loop {
        round += 1;
        let mut adjustment = Adjustment::new(&capture, &camera, &poses, &noise, true);
        let adjusted = adjustment.solve()?;
        (camera, poses) = (adjusted.camera.clone(), adjusted.poses.clone());
        let used = noise;
        let covariance = adjustment.covariance()?;
        let (image_redundancy, depth_redundancy) = adjustment.redundancies(&covariance);
        let inflation = |n: usize, redundancy: f64| n as f64 / redundancy.max(1.0);
        let n = adjusted.image_residuals.len();
        noise.pixel_sigma *= clipped_sigma(&adjusted.image_residuals) * inflation(n, image_redundancy).sqrt();
        let residuals = inverse_depth_residuals(&capture, &adjusted.depth_residuals, &used);
        if let Some(law) = DepthNoise::fit(&residuals, inflation(residuals.len(), depth_redundancy)) {
            noise.depth = law;
        }
        // The last round keeps its samples, so that the result belongs to them.
        let dropped = if round < ROUNDS { drop_outliers(&mut capture, &residuals, &noise) } else { 0 };
        outliers += dropped;
        let settled = (noise.pixel_sigma / used.pixel_sigma - 1.0).abs() < NOISE_SETTLED
            && residuals
                .iter()
                .all(|(rho, _)| (noise.depth.sigma(*rho) / used.depth.sigma(*rho) - 1.0).abs() < 2.0 * NOISE_SETTLED);
        if dropped == 0 && (settled || round >= ROUNDS) {
            converged(&adjusted)?;
            let camera_covariance = adjustment.camera_covariance(&covariance);
            let depth_mm = depth_residuals_mm(&capture, &adjusted.depth_residuals, &used);
            let (sigma, covariance) = (used.pixel_sigma, Some(camera_covariance));
            let mut result = finish(capture, adjusted, noise, sigma, covariance, Some(&depth_mm), options);
            result.correlation_length_px = correlation;
            result.outliers = outliers;
            check_invertible(&result)?;
            return Ok(result);
        }
    }
}

fn converged(adjusted: &Adjusted) -> Result<(), CalibrateError> {
    if adjusted.report.converged {
        return Ok(());
    }
    Err(CalibrateError::NotConverged { reason: adjusted.report.termination.to_string() })
}

fn finish(
    capture: Capture,
    adjusted: Adjusted,
    noise: NoiseModel,
    pixel_sigma_used: f64,
    covariance: Option<DMatrix<f64>>,
    depth_mm: Option<&[f64]>,
    options: &CalibrateOptions,
) -> Calibrated {
    let stds = capture.frames.iter().flat_map(|f| f.markers.iter().map(|m| m.std_px * pixel_sigma_used));
    let squares = adjusted.image_residuals.chunks_exact(2).zip(stds);
    let (sum, n) = squares.fold((0.0, 0), |(s, n), (r, std)| (s + (r[0] * r[0] + r[1] * r[1]) * std * std, n + 1));
    Calibrated {
        poses: adjusted.poses,
        covariance,
        noise,
        with_depth: depth_mm.is_some(),
        correlation_length_px: None,
        outliers: 0,
        reprojection_rms_px: (sum / f64::from(n.max(1))).sqrt(),
        depth_rms_mm: depth_mm.map(rms),
        cost: adjusted.report.cost,
        iterations: adjusted.report.iterations,
        termination: adjusted.report.termination.to_string(),
        estimator: options.estimator,
        model: options.model.clone(),
        camera: adjusted.camera,
        capture,
    }
}

/// Root mean square; 0 of nothing.
pub(crate) fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

/// A start camera without lens may put a frame into the wrong one of a plane's two poses, where the adjustment then stays.
/// Estimates every pose anew under the adjusted camera and takes those that fit clearly better; returns how many.
fn leave_mirrored_poses(capture: &Capture, camera: &Camera, poses: &mut [Isometry3<f64>]) -> usize {
    const CLEARLY: f64 = 0.9;
    let better: Vec<Option<Isometry3<f64>>> = capture
        .frames
        .par_iter()
        .zip(&*poses)
        .map(|(frame, pose)| {
            let markers = FrameMarkers { name: &frame.name, markers: &frame.markers };
            let stays = refine_pose(camera, &capture.target, &frame.markers, pose)?;
            let other = estimate_pose(camera, &capture.target, &markers).ok()?;
            (other.rms_px < CLEARLY * stays.rms_px).then_some(other.camera_from_board)
        })
        .collect();
    let moved = better.iter().flatten().count();
    for (pose, better) in poses.iter_mut().zip(better) {
        *pose = better.unwrap_or(*pose);
    }
    moved
}

/// The frame that fits far worse than the others, and why it goes.
fn worst_frame(capture: &Capture, residuals: &[f64], sigma: f64) -> Option<(usize, String)> {
    let mut rest = residuals;
    let errors: Vec<f64> = capture
        .frames
        .iter()
        .map(|frame| {
            let (own, after) = rest.split_at((2 * frame.markers.len()).min(rest.len()));
            rest = after;
            let squares =
                own.iter().zip(frame.markers.iter().flat_map(|m| [m.std_px; 2])).map(|(r, s)| (r * s).powi(2));
            sigma * (squares.sum::<f64>() / frame.markers.len().max(1) as f64).sqrt()
        })
        .collect();
    let mut sorted = errors.clone();
    sorted.sort_by(f64::total_cmp);
    let median = *sorted.get(sorted.len() / 2)?;
    let (worst, error) = errors.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1))?;
    let reason = format!(
        "its reprojection error is {error:.2} px where the median frame has {median:.2} px: a misdetected board"
    );
    (*error > BAD_FRAME_FLOOR_PX && *error > BAD_FRAME_RATIO * median).then_some((worst, reason))
}

/// Depth noise to start with: deviations from a plane of each frame's own.
fn depth_noise_from_planes(capture: &Capture) -> DepthNoise {
    let mut samples = Vec::new();
    for frame in &capture.frames {
        let pixels: Vec<_> = frame
            .samples
            .iter()
            .map(|s| crate::board_region::BoardPixel {
                context: s.context,
                depth_mm: s.depth_mm,
                board_depth_mm: s.depth_mm,
                board: s.board_seed,
                // Pixels instead of rays: a plane is affine in either, up to the lens.
                ray: [s.context.pixel[0] / 1000.0, s.context.pixel[1] / 1000.0],
                cos_incidence: 1.0,
            })
            .collect();
        let deviations = crate::depth_sampling::plane_deviations(&pixels);
        samples.extend(pixels.iter().zip(deviations).map(|(p, d)| (1.0 / p.depth_mm, d)));
    }
    let least = 1e-7;
    let law = DepthNoise::fit(&samples, 1.0).unwrap_or(DepthNoise { a_per_mm: 1e-5, b_mm: 0.0 });
    DepthNoise { a_per_mm: law.a_per_mm.max(least), ..law }
}

/// Gives samples that came without a depth image the board point that their ray meets; those that meet none go.
fn seed_samples(capture: &mut Capture, from_image: &Calibrated) {
    for (frame, pose) in capture.frames.iter_mut().zip(&from_image.poses) {
        let plane = BoardPlane::new(pose);
        frame.samples.retain_mut(|sample| {
            if sample.board_seed[0].is_finite() {
                return true;
            }
            let ray = from_image.camera.ray(sample.context.pixel, 1.0 / sample.depth_mm).ok();
            let point = ray.and_then(|ray| plane.depth(ray).map(|z| plane.to_board(ray, z)));
            sample.board_seed = point.map_or([f64::NAN; 2], |p| [p.x, p.y]);
            point.is_some()
        });
    }
}

/// (inverse depth, residual in inverse depth) of every sample, 1/mm.
fn inverse_depth_residuals(capture: &Capture, whitened: &[f64], noise: &NoiseModel) -> Vec<(f64, f64)> {
    let samples = capture.frames.iter().flat_map(|f| f.samples.iter());
    samples
        .zip(whitened)
        .map(|(s, r)| {
            let rho = 1.0 / s.depth_mm;
            (rho, r * noise.depth.sigma(rho))
        })
        .collect()
}

/// Measured minus predicted depth of every sample, mm.
fn depth_residuals_mm(capture: &Capture, whitened: &[f64], noise: &NoiseModel) -> Vec<f64> {
    inverse_depth_residuals(capture, whitened, noise).iter().map(|(rho, r)| 1.0 / rho - 1.0 / (rho + r)).collect()
}

/// Takes samples out that no noise explains; returns how many.
fn drop_outliers(capture: &mut Capture, residuals: &[(f64, f64)], noise: &NoiseModel) -> usize {
    let mut rest = residuals.iter();
    let mut dropped = 0;
    for frame in &mut capture.frames {
        frame.samples.retain(|_| {
            let keep = rest.next().is_none_or(|(rho, r)| r.abs() <= OUTLIER * noise.depth.sigma(*rho));
            dropped += usize::from(!keep);
            keep
        });
    }
    dropped
}

/// The fitted camera must be invertible at every sample that it was fitted to.
fn check_invertible(result: &Calibrated) -> Result<(), CalibrateError> {
    for frame in &result.capture.frames {
        for sample in frame.samples.iter().step_by(10) {
            result.camera.correct(&sample.context, 1.0, 1.0 / sample.depth_mm)?;
        }
    }
    Ok(())
}
