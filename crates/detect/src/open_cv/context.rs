//! OpenCV's errors as this crate's.

use crate::error::DetectError;

/// Names the operation in which OpenCV failed.
pub(super) trait Context<T> {
    fn context(self, operation: &'static str) -> Result<T, DetectError>;
}

impl<T> Context<T> for Result<T, opencv::Error> {
    fn context(self, operation: &'static str) -> Result<T, DetectError> {
        self.map_err(|error| DetectError::OpenCv { operation, source: Box::new(error) })
    }
}
