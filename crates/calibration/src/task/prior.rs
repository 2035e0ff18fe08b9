//! The prior of a fleet for the fit of a camera.

use depthcal_io::Prior;

use super::error::TaskError;
use crate::adjust::camera_prior::CameraPrior;

/// Prior of a camera's parameters from other units of its type.
#[derive(Debug, Clone)]
pub struct GivenPrior {
    /// The camera of a rig; `None` of a camera alone.
    pub camera: Option<String>,
    /// Name of its file, for messages.
    pub name: String,
    /// Its contents.
    pub prior: Prior,
}

impl GivenPrior {
    /// The prior for images of `size` (width, height), px.
    ///
    /// # Errors
    ///
    /// [`TaskError::PriorSize`] where it is for images of another size.
    pub fn for_size(&self, size: [usize; 2]) -> Result<CameraPrior, TaskError> {
        let expected = [self.prior.width, self.prior.height];
        if expected != size {
            return Err(TaskError::PriorSize { prior: self.name.clone(), expected, found: size });
        }
        Ok(CameraPrior::from(&self.prior))
    }
}
