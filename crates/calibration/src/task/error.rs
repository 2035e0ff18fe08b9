//! Why a task fails.

use std::fmt::Display;

use depthcal_formula::NamedFileError;
use depthcal_io::FileError;
use thiserror::Error;

use crate::calibrate::CalibrateError;
use crate::load::DeclaredCameraError;

/// Why a task fails.
#[derive(Debug, Error)]
pub enum TaskError {
    /// The text of an option means nothing.
    #[error("{option} {text}: {problem}")]
    Option {
        /// Name of the option, as its user writes it.
        option: String,
        /// The text that it was given.
        text: String,
        /// What is wrong with it, and the remedy.
        problem: String,
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
    /// There is no calibration.
    #[error(transparent)]
    Calibrate(#[from] CalibrateError),
    /// A result cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
}

impl TaskError {
    /// Whether the fit itself cannot be trusted (rather than the input being at fault).
    pub fn is_untrusted_fit(&self) -> bool {
        matches!(self, Self::Calibrate(error) if error.is_untrusted_fit())
    }

    pub(crate) fn option(option: &str, text: &str, problem: impl Display) -> Self {
        Self::Option { option: option.to_owned(), text: text.to_owned(), problem: problem.to_string() }
    }
}
