//! The prior of a fleet for the fit of a camera.

use depthcal_io::Prior;

use super::error::TaskError;
use crate::adjust::camera_prior::CameraPrior;

/// A prior for images of `size` (width, height), px; `name` is that of its file, for messages.
///
/// # Errors
///
/// [`TaskError::PriorSize`] where it is for images of another size.
pub fn prior_for(name: &str, prior: &Prior, size: [usize; 2]) -> Result<CameraPrior, TaskError> {
    let expected = [prior.width, prior.height];
    if expected != size {
        return Err(TaskError::PriorSize { prior: name.to_owned(), expected, found: size });
    }
    Ok(CameraPrior::from(prior))
}
