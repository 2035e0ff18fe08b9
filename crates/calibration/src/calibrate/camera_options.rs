//! Options of a calibration: models, start values, held parameters and estimator.

use std::sync::Arc;

use depthcal_model::{Camera, ModelSpec, PieceSpec, Register, Target};

use super::held::HeldParameter;
use crate::adjust::FieldThresholds;
use crate::adjust::camera_prior::CameraPrior;
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

/// Options of a calibration: models, start values, held parameters and estimator.
#[derive(Debug, Clone)]
pub struct CameraOptions {
    /// Depth model.
    pub model: ModelSpec,
    /// Further effects, at whatever hook they act; those of depth act before the depth model.
    pub effects: Vec<PieceSpec>,
    /// Parameters that are held at their nominal values.
    pub held: Vec<HeldParameter>,
    /// Lens model: one of [`lens_models`](crate::start::lens_models); `auto`, which compares these; or `brown-conrady:ORDER` with
    /// the name of a [`LensOrder`](super::LensOrder). The order of `brown-conrady` is chosen where the markers do not determine
    /// it over the whole image.
    pub lens: String,
    /// How the depth model is estimated.
    pub estimator: Estimator,
    /// Most depth pixels of a frame that enter the adjustment.
    pub samples_per_frame: usize,
    /// Whether depth samples have what any piece of the register needs, not only those of the model: for a search for missing
    /// effects.
    pub samples_for_search: bool,
    /// Whether every frame may have a plane of its own that is added to its depth. The variance of these planes is then
    /// estimated, and the weight of depth relative to the markers is lowered accordingly, if that predicts left-out frames
    /// better. Not used for models with fields, which describe such planes themselves.
    pub frame_planes: bool,
    /// A camera to start from, or, where its parameters are held, to keep.
    pub camera: Option<Camera>,
    /// A prior of the camera's parameters from other units of its type. Without a camera to start from, the fit starts at its
    /// mean, so that few frames are enough.
    pub prior: Option<Arc<CameraPrior>>,
    /// The pieces that names may mean.
    pub register: Register,
    /// Most rounds in which the smoothness of fields and the noise are chosen in turn; most fits settle in four to six.
    pub smoothness_rounds: usize,
    /// Thresholds of the rules that choose the smoothness of fields.
    pub field_thresholds: FieldThresholds,
    /// Receives progress.
    pub progress: ProgressHandle,
}

impl CameraOptions {
    /// These options with a register that knows the board ([`Register::for_board`]).
    #[must_use]
    pub fn for_board(&self, target: &Target) -> Self {
        Self { register: self.register.clone().for_board(target), ..self.clone() }
    }
}

impl Default for CameraOptions {
    fn default() -> Self {
        Self {
            model: ModelSpec::of(PieceSpec::new("projective")),
            effects: Vec::new(),
            held: Vec::new(),
            lens: "brown-conrady".to_owned(),
            estimator: Estimator::Joint,
            samples_per_frame: 800,
            samples_for_search: false,
            frame_planes: true,
            camera: None,
            prior: None,
            register: Register::builtin(),
            smoothness_rounds: 12,
            field_thresholds: FieldThresholds::default(),
            progress: ProgressHandle::default(),
        }
    }
}
