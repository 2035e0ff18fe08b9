//! Frames of another capture under the camera of a fit.

use depthcal_model::{Block, needed_light};

use super::calibrated_camera::CalibratedCamera;
use super::camera_options::CameraOptions;
use super::error::CalibrateError;
use super::frame_checks::posed;
use super::joint::sample;
use crate::observe::CameraFrames;

/// A fit with the frames of another capture instead of its own: their poses are those of their markers, their depth is sampled as
/// `options` say. Nothing is adjusted; covariance and noise are those of the fit.
///
/// # Errors
///
/// [`CalibrateError`] where no frame shows depth on the board, or an image has become unreadable.
pub fn sampled_under(
    fit: &CalibratedCamera,
    capture: &CameraFrames,
    options: &CameraOptions,
) -> Result<CalibratedCamera, CalibrateError> {
    let light = needed_light(fit.camera.blocks().iter().filter_map(Block::piece).map(|piece| &**piece));
    let (capture, _) = sample(posed(capture, &fit.camera), &fit.camera, light, options)?;
    Ok(CalibratedCamera { capture, ..fit.clone() })
}
