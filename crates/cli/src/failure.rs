//! Why a command fails.

use std::fmt::Display;

use depthcal_calibration::calibrate::CalibrateError;
use depthcal_calibration::task::TaskError;
use depthcal_formula::NamedFileError;

/// Why a command fails, by exit code.
#[derive(Debug)]
pub(super) enum Failure {
    /// Invalid input or arguments: exit code 1.
    Input(String),
    /// A fit that cannot be trusted: exit code 2.
    Untrusted(String),
}

/// Any error of input or output.
pub(super) fn input(error: impl Display) -> Failure {
    Failure::Input(error.to_string())
}

impl From<CalibrateError> for Failure {
    fn from(error: CalibrateError) -> Self {
        if error.is_untrusted_fit() { Failure::Untrusted(error.to_string()) } else { Failure::Input(error.to_string()) }
    }
}

impl From<TaskError> for Failure {
    fn from(error: TaskError) -> Self {
        if error.is_untrusted_fit() { Failure::Untrusted(error.to_string()) } else { Failure::Input(error.to_string()) }
    }
}

impl From<NamedFileError> for Failure {
    fn from(error: NamedFileError) -> Self {
        input(error)
    }
}
