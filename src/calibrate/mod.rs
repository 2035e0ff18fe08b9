//! From captures to a calibrated depth camera.

mod image;
mod joint;

use depthcal_model::{Block, Camera, CameraError, Register, RegisterError};
use depthcal_solver::{CovarianceError, SolveError};
use nalgebra::{DMatrix, Isometry3};
use thiserror::Error;
use tracing::info;

use crate::adjustment::Adjusted;
use crate::estimators::{self, EstimatorError};
use crate::noise::NoiseModel;
use crate::observations::Capture;
use crate::smoothness::Smoothness;
use crate::start::StartError;

pub use image::calibrate_image;

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
    /// Further effects by name, at whatever hook they act; those of depth act before the depth model.
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

impl CalibrateOptions {
    /// Whether all models and effects are known, before anything is read.
    ///
    /// # Errors
    ///
    /// [`OptionError`], naming the option.
    pub fn check_names(&self) -> Result<(), OptionError> {
        let model = self.register.depth_model(&self.model);
        model.map_err(|source| OptionError { option: format!("--model {}", self.model), source })?;
        for name in &self.effects {
            let block = self.register.block(name, None);
            block.map_err(|source| OptionError { option: format!("--with {name}"), source })?;
        }
        Ok(())
    }
}

/// A model or effect that is not known.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{option}: {source}")]
pub struct OptionError {
    /// The option as given.
    pub option: String,
    /// What is wrong with it.
    pub source: RegisterError,
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
    /// Fields of the depth model: how rough they may be, what determines them.
    pub smoothness: Smoothness,
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
    /// Depth model as asked for.
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

/// Rounds of adjustment and noise estimation.
const ROUNDS: usize = 4;
/// Change of a standard deviation that ends the rounds.
const NOISE_SETTLED: f64 = 0.01;
/// Markers are never believed better than this, px: simulated ones may be exact.
const LEAST_PIXEL_SIGMA: f64 = 1e-4;
/// Nor is depth better than this, 1/mm: a micrometre at 1 m.
const LEAST_INVERSE_DEPTH_SIGMA: f64 = 1e-9;

/// Calibrates a depth camera: markers first, then depth by the estimator asked for.
///
/// # Errors
///
/// [`CalibrateError`]; see [`CalibrateError::is_untrusted_fit`] for which of them speak of the fit.
pub fn calibrate(capture: &Capture, options: &CalibrateOptions) -> Result<Calibrated, CalibrateError> {
    depth_blocks(options)?;
    let from_image = calibrate_image(capture, options)?;
    info!(
        "{} frames, {:.3} px rms from the image alone",
        from_image.capture.frames.len(),
        from_image.reprojection_rms_px
    );
    calibrate_depth(from_image, options)
}

/// Fits the depth model by the estimator asked for, on top of a calibration from the images alone.
///
/// # Errors
///
/// [`CalibrateError`]; see [`CalibrateError::is_untrusted_fit`] for which of them speak of the fit.
pub fn calibrate_depth(from_image: Calibrated, options: &CalibrateOptions) -> Result<Calibrated, CalibrateError> {
    let depth_blocks = depth_blocks(options)?;
    if !from_image.capture.has_depth() {
        if options.model == "none" && depth_blocks.is_empty() {
            return Ok(from_image);
        }
        let (dataset, model) = (from_image.capture.name.clone(), options.model.clone());
        return Err(CalibrateError::NoDepth { dataset, model });
    }
    match options.estimator {
        Estimator::Joint => joint::joint(from_image, depth_blocks, options),
        other => Ok(estimators::estimate(from_image, depth_blocks, other)?),
    }
}

/// Effects are the sensor's and act on the true depth; the depth model, as D does, distorts what they leave.
fn depth_blocks(options: &CalibrateOptions) -> Result<Vec<Block>, RegisterError> {
    let mut blocks = Vec::new();
    for name in &options.effects {
        let block = options.register.block(name, None)?;
        if crate::adjustment::is_depth_only(&block) {
            blocks.push(block);
        }
    }
    blocks.extend(options.register.depth_model(&options.model)?);
    Ok(blocks)
}

fn converged(adjusted: &Adjusted) -> Result<(), CalibrateError> {
    // Residuals far below any noise have nothing left to fall by: exact observations, where rounding hides the descent.
    let residuals = (adjusted.image_residuals.len() + adjusted.depth_residuals.len()) as f64;
    if adjusted.report.converged || adjusted.report.cost < 1e-6 * residuals {
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
        smoothness: Smoothness::default(),
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
