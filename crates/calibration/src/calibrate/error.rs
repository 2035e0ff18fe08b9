//! Why there is no calibration.

use depthcal_model::{CameraError, RegisterError};
use depthcal_solver::{CovarianceError, NoiseError, SolveError};
use thiserror::Error;

use depthcal_io::ImageError;

use super::depth_scale::{DepthOffset, ImplausibleScale, SeveralUnits};
use super::frame_contradiction::FrameContradiction;
use super::rig_contradiction::RigContradiction;
use super::undetermined::UndeterminedModel;
#[cfg(feature = "detect")]
use crate::cause::BoardCause;
use crate::cause::DepthCause;
use crate::estimators::EstimatorError;
use crate::start::StartError;
use crate::start::views::ExtrinsicsError;

/// Why there is no calibration.
#[derive(Debug, Error)]
pub enum CalibrateError {
    /// No start values.
    #[error(transparent)]
    Start(#[from] StartError),
    /// An image cannot be read.
    #[error(transparent)]
    Image(#[from] ImageError),
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
    #[error("{0}")]
    Undetermined(Box<UndeterminedModel>),
    /// The covariance cannot be computed for another reason.
    #[error("the precision of the model cannot be computed: {0}")]
    Covariance(#[from] CovarianceError),
    /// A parameter is to be held that the model does not have.
    #[error("there is no parameter '{held}' to be held; the model has {}", known.join(", "))]
    UnknownHeld {
        /// The parameter as it was asked for.
        held: String,
        /// The parameters of the model.
        known: Vec<String>,
    },
    /// A focal length is to be held, but no value is declared.
    #[error("'{held}' has no value at which it could be held: declare it under [camera] in dataset.toml")]
    HeldWithoutValue {
        /// The parameter as it was asked for.
        held: String,
    },
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
    /// No depth image has a measurement anywhere.
    #[error(
        "none of the {frames} depth images of '{dataset}' has any measurement (all values are 0, or the type's largest): check that the \
             depth glob finds depth images, and that the sensor recorded depth"
    )]
    NoMeasurement {
        /// The dataset.
        dataset: String,
        /// The number of depth images.
        frames: usize,
    },
    /// Depth of some frames is in another unit.
    #[error(transparent)]
    Units(#[from] SeveralUnits),
    /// Depth and image disagree by a factor that no camera has.
    #[error(transparent)]
    Scale(#[from] ImplausibleScale),
    /// Depth is far off by one length.
    #[error(transparent)]
    Offset(#[from] DepthOffset),
    /// Depth is something else than what is declared.
    #[error("{0}")]
    Depth(Box<DepthCause>),
    /// Depth contradicts the boards, and no alternative fits.
    #[error(
        "depth contradicts the boards that the images show: even with the unit that fits best it is off by {:.0} % of the distance; mirrored, turned \
         and transposed depth, ranges, disparities, exchanged bytes, depth of the frame before or after, and depth on a pixel grid of its own were \
         tried and do not fit either: check that image and depth show the same scene", 100.0 * .deviation
    )]
    DepthUnexplained {
        /// Relative deviation that most points do not exceed.
        deviation: f64,
    },
    /// The board is another than the declared one.
    #[cfg(feature = "detect")]
    #[error("{cause} (as declared: {source})")]
    Board {
        /// The board that the images show.
        cause: Box<BoardCause>,
        /// The failure of the declared board.
        source: Box<CalibrateError>,
    },
    /// The cameras of a rig contradict each other.
    #[error("{0}")]
    RigContradiction(Box<RigContradiction>),
    /// The frames of a camera contradict each other.
    #[error("{0}")]
    FrameContradiction(Box<FrameContradiction>),
    /// The fitted camera cannot be inverted where it was fitted.
    #[error("the fitted model folds: {0}")]
    Folded(#[from] CameraError),
    /// One camera of several cannot be calibrated.
    #[error("camera {camera}: {source}")]
    Camera {
        /// The camera.
        camera: String,
        /// Why.
        source: Box<CalibrateError>,
    },
    /// No camera has images.
    #[error(
        "no camera of '{dataset}' found the board in an image: poses come from images, so at least one camera needs them"
    )]
    NoImages {
        /// The dataset.
        dataset: String,
    },
    /// The first camera, whose frame is the rig's, has no images.
    #[error(
        "the first camera, {camera}, is the reference and needs images: put a camera with images first in dataset.toml"
    )]
    ReferenceWithoutImages {
        /// The camera.
        camera: String,
    },
    /// The cameras' relative poses cannot be determined.
    #[error(transparent)]
    Extrinsics(#[from] ExtrinsicsError),
    /// The time offset of a camera cannot be estimated.
    #[error("the time offset of {camera} cannot be estimated: {reason}")]
    TimeOffset {
        /// The camera.
        camera: String,
        /// The missing data and the remedy, in words.
        reason: String,
    },
    /// A depth camera without images has no start values.
    #[error("camera {camera} has depth without images, and {reason}")]
    DepthStart {
        /// The camera.
        camera: String,
        /// The missing data and the remedy, in words.
        reason: String,
    },
    /// An effect depends on a column of `frames.csv` that the dataset lacks.
    #[error(
        "the effect '{effect}' depends on '{column}', but the frames of '{dataset}' have no such values: give the column {column} in \
         frames.csv, {known}"
    )]
    UnknownQuantity {
        /// The effect.
        effect: String,
        /// The column.
        column: String,
        /// The dataset.
        dataset: String,
        /// The columns that there are, in words.
        known: String,
    },
    /// A prior has no finite standard deviation.
    #[error("a prior of the camera's parameters cannot be used: {0}; declare intrinsics that are finite and not zero")]
    Prior(#[from] NoiseError),
}

impl CalibrateError {
    /// An error of one camera of several.
    pub(crate) fn of_camera(camera: &str) -> impl Fn(Self) -> Self + '_ {
        move |source| Self::Camera { camera: camera.to_owned(), source: Box::new(source) }
    }

    /// Whether the fit itself cannot be trusted (rather than the input being at fault).
    pub fn is_untrusted_fit(&self) -> bool {
        match self {
            Self::Camera { source, .. } => source.is_untrusted_fit(),
            Self::Solve(_)
            | Self::NotConverged { .. }
            | Self::Undetermined(_)
            | Self::Covariance(_)
            | Self::Folded(_)
            | Self::RigContradiction(_)
            | Self::FrameContradiction(_)
            | Self::Extrinsics(ExtrinsicsError::Moved { .. }) => true,
            _ => false,
        }
    }
}
