//! Failures as Python exceptions, with the messages and the classes of the command line.

use std::fmt::Display;

use depthcal_calibration::task::TaskError;
use pyo3::create_exception;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;

create_exception!(depthcal, Error, PyException, "Why depthcal has no result; the class of all its exceptions.");
create_exception!(
    depthcal,
    InputError,
    Error,
    "Files, arrays or arguments are at fault: exit code 1 of the command line. The message names what, and the remedy."
);
create_exception!(
    depthcal,
    UntrustedFitError,
    Error,
    "The fit cannot be trusted: exit code 2 of the command line. It did not converge, parameters are undetermined, or the model folds."
);

/// Why there is no result.
#[derive(Debug)]
pub(crate) enum Failure {
    /// Files, arrays or arguments are at fault.
    Input(String),
    /// A fit that cannot be trusted.
    Untrusted(String),
    /// An exception of Python's own, such as one that an effect raised.
    Python(PyErr),
}

/// Any error of input or output.
pub(crate) fn input(error: impl Display) -> Failure {
    Failure::Input(error.to_string())
}

impl From<TaskError> for Failure {
    fn from(error: TaskError) -> Self {
        if error.is_untrusted_fit() { Self::Untrusted(error.to_string()) } else { input(error) }
    }
}

impl From<PyErr> for Failure {
    fn from(error: PyErr) -> Self {
        Self::Python(error)
    }
}

impl From<Failure> for PyErr {
    fn from(failure: Failure) -> Self {
        match failure {
            Failure::Input(message) => InputError::new_err(message),
            Failure::Untrusted(message) => UntrustedFitError::new_err(message),
            Failure::Python(error) => error,
        }
    }
}
