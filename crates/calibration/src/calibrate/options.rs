//! What to fit, and how.

use depthcal_model::{Camera, Register, RegisterError};
use thiserror::Error;

use crate::adjust::FieldThresholds;
use crate::progress::ProgressHandle;

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
    /// Thresholds of the rules that choose the smoothness of fields.
    pub field_thresholds: FieldThresholds,
    /// Receives progress.
    pub progress: ProgressHandle,
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
            field_thresholds: FieldThresholds::default(),
            progress: ProgressHandle::default(),
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
