//! Why there is no calibration of a rig.

use depthcal_calibration::calibrate::CalibrateError;
use depthcal_calibration::diagnose::DiagnoseError;
use depthcal_calibration::load::{DeclaredCameraError, LoadError};
use depthcal_io::{DatasetError, ImageError};
use depthcal_model::CameraError;
use depthcal_solver::score::ScoreError;
use depthcal_solver::{CovarianceError, NoiseError, SolveError};
use thiserror::Error;

/// Why there is no calibration of a rig.
#[derive(Debug, Error)]
pub enum RigError {
    /// The dataset's description is at fault.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// The files of a camera give no observations.
    #[error("camera {camera}: {source}")]
    Load {
        /// The camera.
        camera: String,
        /// Why.
        source: Box<LoadError>,
    },
    /// The intrinsics that are declared for a camera cannot be used.
    #[error("camera {camera}: {source}")]
    Declared {
        /// The camera.
        camera: String,
        /// Why.
        source: Box<DeclaredCameraError>,
    },
    /// A camera cannot be calibrated alone.
    #[error("camera {camera}: {source}")]
    Camera {
        /// The camera.
        camera: String,
        /// Why.
        source: Box<CalibrateError>,
    },
    /// No camera has images.
    #[error(
        "no camera of '{rig}' found the board in an image: poses come from images, so at least one camera needs them"
    )]
    NoImages {
        /// The rig.
        rig: String,
    },
    /// The first camera, whose frame is the rig's, has no images.
    #[error(
        "the first camera, {camera}, is the reference and needs images: put a camera with images first in dataset.toml"
    )]
    ReferenceWithoutImages {
        /// The camera.
        camera: String,
    },
    /// No chain of shared views leads from the reference to a camera.
    #[error(
        "camera {camera} shares too few views with the others ({shared}): it needs at least {needed} frames in which it and a camera \
         that is connected to {reference} see the board; check that frames of the cameras are paired ([frames] within_s, or a table)"
    )]
    Unconnected {
        /// The camera.
        camera: String,
        /// The reference.
        reference: String,
        /// Shared views of the best pair.
        shared: usize,
        /// Views that are needed.
        needed: usize,
    },
    /// The cameras have moved against each other.
    #[error(
        "{camera} has moved against {other}: {first} frames ({first_frames}) fit one place, {second} frames ({second_frames}) another, \
         {angle_deg:.2}° and {distance_mm:.1} mm away: calibrate these frames apart, and fasten the cameras"
    )]
    Moved {
        /// The camera.
        camera: String,
        /// The camera that it is seen with.
        other: String,
        /// Number of frames that fit the first place.
        first: usize,
        /// Their names, some of them.
        first_frames: Box<str>,
        /// Number of frames that fit the second place.
        second: usize,
        /// Their names, some of them.
        second_frames: Box<str>,
        /// Angle between the places, degrees.
        angle_deg: f64,
        /// Distance between the places, mm.
        distance_mm: f64,
    },
    /// The time offset of a camera cannot be estimated.
    #[error("the time offset of {camera} cannot be estimated: {reason}")]
    TimeOffset {
        /// The camera.
        camera: String,
        /// What is lacking, and the remedy.
        reason: String,
    },
    /// A depth camera without images has no start values.
    #[error("camera {camera} has depth without images, and {reason}")]
    DepthStart {
        /// The camera.
        camera: String,
        /// What is lacking, and the remedy.
        reason: String,
    },
    /// No camera has depth.
    #[error(
        "no camera of '{rig}' has depth: a diagnosis needs it; add depth to a section [cameras.NAME] of dataset.toml"
    )]
    NoDepth {
        /// The rig.
        rig: String,
    },
    /// A calibration of the rig lacks a camera that was captured.
    #[error("the calibration of the rig has no camera {camera} although it was captured: please report this as a bug")]
    NotFitted {
        /// The camera.
        camera: String,
    },
    /// A camera cannot be diagnosed.
    #[error("camera {camera}: {source}")]
    Diagnose {
        /// The camera.
        camera: String,
        /// Why.
        source: Box<DiagnoseError>,
    },
    /// An image has become unreadable.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// A prior has no finite standard deviation.
    #[error("a prior of the rig cannot be used: {0}; declare intrinsics that are finite and not zero")]
    Prior(#[from] NoiseError),
    /// The solver failed.
    #[error("the joint adjustment failed: {0}")]
    Solve(#[from] SolveError),
    /// Effects that a model may lack cannot be tested.
    #[error("effects that the model may lack cannot be tested: {0}")]
    Score(#[from] ScoreError),
    /// It stopped before it had converged.
    #[error("the joint adjustment did not converge ({reason}); its result cannot be trusted")]
    NotConverged {
        /// The solver's words.
        reason: String,
    },
    /// The captures leave parameters undetermined.
    #[error(
        "the captures leave {combinations} combination(s) undetermined of {}: capture boards at other distances, tilts and places, or \
         declare intrinsics with fixed = true",
        parameters.join(", ")
    )]
    Undetermined {
        /// Number of combinations.
        combinations: usize,
        /// The parameters that take part, `CAMERA/PIECE.PARAMETER`.
        parameters: Vec<String>,
    },
    /// The covariance cannot be computed for another reason.
    #[error("the precision of the rig cannot be computed: {0}")]
    Covariance(CovarianceError),
    /// A fitted camera cannot be inverted where it was fitted.
    #[error("camera {camera}: the fitted model folds: {source}")]
    Folded {
        /// The camera.
        camera: String,
        /// Where.
        source: CameraError,
    },
}

impl RigError {
    /// An error of one camera.
    pub(crate) fn of(camera: &str) -> impl Fn(CalibrateError) -> Self + '_ {
        move |source| Self::Camera { camera: camera.to_owned(), source: Box::new(source) }
    }

    /// Whether the fit itself cannot be trusted (rather than the input being at fault).
    pub fn is_untrusted_fit(&self) -> bool {
        match self {
            Self::Camera { source, .. } => source.is_untrusted_fit(),
            Self::Diagnose { source, .. } => match &**source {
                DiagnoseError::Calibrate(error) => error.is_untrusted_fit(),
                DiagnoseError::NoDepth { .. } => false,
                DiagnoseError::Score(_) | DiagnoseError::NotFitted { .. } => true,
            },
            Self::Solve(_)
            | Self::Score(_)
            | Self::NotConverged { .. }
            | Self::Undetermined { .. }
            | Self::Covariance(_)
            | Self::Folded { .. }
            | Self::Moved { .. } => true,
            _ => false,
        }
    }
}
