//! Why a task fails.

use std::fmt::Display;

use depthcal_formula::NamedFileError;
use depthcal_io::{CameraFileError, FileError};
use depthcal_model::RegisterError;
use thiserror::Error;

use super::option_names::OptionNames;
use super::unlike_calibration::UnlikeCalibration;
use crate::calibrate::CalibrateError;
use crate::camera_record::RecordError;
use crate::diagnose::DiagnoseError;
use crate::load::{DeclaredCameraError, LoadError};
use crate::plan::PlanError;

/// Why a task fails.
#[derive(Debug, Error)]
pub enum TaskError {
    /// No captures can be planned.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// The text of an option means nothing.
    #[error("{option} {text}: {problem}")]
    Option {
        /// Name of the option, as its user writes it.
        option: String,
        /// The text that it was given.
        text: String,
        /// The fault and the remedy, in words.
        problem: String,
    },
    /// An option that is for one camera alone, where the dataset has several.
    #[error("{option} is for one camera, and this dataset has several: {remedy}")]
    OneCamera {
        /// Name of the option, as its user writes it.
        option: &'static str,
        /// The remedy.
        remedy: String,
    },
    /// The dataset is at fault.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// The dataset is not one of the calibration's cameras.
    #[error(transparent)]
    Unlike(#[from] UnlikeCalibration),
    /// There is no depth.
    #[error("the dataset '{dataset}' has no depth images: nothing to compare")]
    NoDepth {
        /// The dataset.
        dataset: String,
    },
    /// There are fewer frames than parts of a cross-validation.
    #[error(
        "{} {folds} needs as many frames, but the board was found in {frames}: give fewer {}, but at least 2, or {}",
        names.folds, names.folds, names.verify
    )]
    Folds {
        /// Names of the options.
        names: Box<OptionNames>,
        /// The number of parts.
        folds: usize,
        /// The number of frames.
        frames: usize,
    },
    /// A file of formulas is at fault.
    #[error(transparent)]
    Formula(#[from] NamedFileError),
    /// The camera that the dataset declares is at fault.
    #[error(transparent)]
    Camera(#[from] DeclaredCameraError),
    /// A prior is for another camera type.
    #[error(
        "{prior}: is for images of {}×{} px, but those of the dataset have {}×{}: give the prior of this camera type",
        expected[0], expected[1], found[0], found[1]
    )]
    PriorSize {
        /// The prior's file.
        prior: String,
        /// Width and height of the images that it is for, px.
        expected: [usize; 2],
        /// Those of the dataset.
        found: [usize; 2],
    },
    /// A camera file of another program is at fault.
    #[error(transparent)]
    CameraFile(#[from] CameraFileError),
    /// A file does not make a camera.
    #[error("{file}: {error}")]
    GivenCamera {
        /// The file.
        file: String,
        /// Why.
        error: Box<RecordError>,
    },
    /// Neither of two camera files says how large the images are.
    #[error("neither {first} nor {second} says how large the images are: give {option}, such as 640x480")]
    NoSize {
        /// The first file.
        first: String,
        /// The second.
        second: String,
        /// Name of the option, as its user writes it.
        option: String,
    },
    /// Two calibrations of a camera are of images of different sizes.
    #[error(
        "{camera} has images of {}x{} px in {first}, but of {}x{} px in {second}: give two calibrations of one resolution",
        sizes[0][0], sizes[0][1], sizes[1][0], sizes[1][1]
    )]
    DifferentSizes {
        /// The camera, in words.
        camera: String,
        /// The first calibration.
        first: String,
        /// The second.
        second: String,
        /// Widths and heights, px.
        sizes: [[usize; 2]; 2],
    },
    /// Two calibrations have no camera in common.
    #[error("{first} has the cameras {}, and {second} {}: none has the same name in both", names[0], names[1])]
    NoCommonCamera {
        /// The first calibration.
        first: String,
        /// The second.
        second: String,
        /// Names of the cameras of either.
        names: [String; 2],
    },
    /// There is no calibration.
    #[error(transparent)]
    Calibrate(#[from] CalibrateError),
    /// The depth of a dataset that a camera is evaluated on contradicts the dataset's images.
    #[error("{path}: {error}")]
    Contradiction {
        /// The dataset.
        path: String,
        /// The contradiction.
        error: Box<CalibrateError>,
    },
    /// There is no diagnosis.
    #[error(transparent)]
    Diagnose(#[from] DiagnoseError),
    /// A model of a comparison is unknown.
    #[error(transparent)]
    Register(#[from] RegisterError),
    /// A result cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
}

impl TaskError {
    /// Whether the fit itself cannot be trusted (rather than the input being at fault).
    pub fn is_untrusted_fit(&self) -> bool {
        match self {
            Self::Calibrate(error) => error.is_untrusted_fit(),
            Self::Diagnose(error) => error.is_untrusted_fit(),
            _ => false,
        }
    }

    pub(crate) fn option(option: &str, text: &str, problem: impl Display) -> Self {
        Self::Option { option: option.to_owned(), text: text.to_owned(), problem: problem.to_string() }
    }
}
