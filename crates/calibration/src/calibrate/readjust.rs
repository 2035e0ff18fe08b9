//! A model adjusted again from a fit that is nearly right: to a part of its frames, or with other effects. Far cheaper than a
//! calibration: the images are not adjusted alone, depth is not sampled again, and few iterations remain.

use depthcal_model::{Block, Camera, RegisterError, Role};

use super::calibrated_camera::CalibratedCamera;
use super::camera_options::CameraOptions;
use super::domain::seen;
use super::error::CalibrateError;
use super::joint::adjust_samples;
use super::model_blocks::{depth_blocks, image_blocks};
use crate::adjust::blocks::is_depth_only;
use crate::observe::noise::NoiseModel;
use crate::observe::{CameraFrames, PosedFrame, SampledFrame};

/// Adjusts the model of `options` jointly to sampled frames, from the camera, poses and noise of `start`. The optimum does not
/// depend on the start; what does is only how many iterations lead there.
///
/// # Errors
///
/// [`CalibrateError`]; see [`CalibrateError::is_untrusted_fit`] for which of them speak of the fit.
pub fn readjust(
    start: &CalibratedCamera,
    mut capture: CameraFrames<SampledFrame>,
    options: &CameraOptions,
) -> Result<CalibratedCamera, CalibrateError> {
    for frame in &mut capture.frames {
        let fitted = start.capture.frames.iter().find(|f| f.name == frame.name);
        if let Some(fitted) = fitted {
            frame.camera_from_board = fitted.camera_from_board;
        }
    }
    if capture.frames.iter().all(|f| f.samples.is_empty()) {
        return Err(CalibrateError::NoDepthOnBoard { dataset: capture.name });
    }
    let camera = with_model(&start.camera, &capture, options)?;
    let mut result = adjust_samples(capture, camera, start.noise, Some(&start.smoothness), options)?;
    result.correlation_length_px = start.correlation_length_px;
    result.lens_choice.clone_from(&start.lens_choice);
    result.lens_comparison.clone_from(&start.lens_comparison);
    Ok(result)
}

/// Adjusts the model of a fit jointly to the part of its frames that was calibrated from the images as `image`, with the samples
/// of the fit and from its depth model, without sampling them again. Outlying samples, wrong markers and the range of fields are
/// those of the fit of all frames: a calibration of these frames alone may decide them otherwise.
///
/// # Errors
///
/// [`CalibrateError`]; see [`CalibrateError::is_untrusted_fit`] for which of them speak of the fit.
pub fn readjust_part(
    image: CalibratedCamera<PosedFrame>,
    fit: &CalibratedCamera,
    options: &CameraOptions,
) -> Result<CalibratedCamera, CalibrateError> {
    let pose_of = |name: &str| image.capture.frames.iter().find(|f| f.name == name).map(|f| f.camera_from_board);
    let mut capture = fit.capture.subset(|_, frame| pose_of(&frame.name).is_some());
    for frame in &mut capture.frames {
        frame.camera_from_board = pose_of(&frame.name).unwrap_or(frame.camera_from_board);
    }
    if capture.frames.iter().all(|f| f.samples.is_empty()) {
        return Err(CalibrateError::NoDepthOnBoard { dataset: capture.name });
    }
    let depth = fit.camera.blocks().iter().filter(|block| is_depth_only(block));
    let camera = depth.fold(image.camera, |camera, block| camera.with_block(block.clone()));
    let noise = NoiseModel { depth: fit.noise.depth, ..image.noise };
    adjust_samples(capture, camera, noise, Some(&fit.smoothness), options)
}

/// Whether a model has fields. Their smoothness is chosen on the way, and its search depends on where it starts: they are fitted
/// from the start.
///
/// # Errors
///
/// [`RegisterError`] where a piece of the model is unknown.
pub fn has_fields(options: &CameraOptions) -> Result<bool, RegisterError> {
    Ok(depth_blocks(options)?.iter().any(|b| b.piece().is_some_and(|p| p.field().is_some())))
}

/// The camera with the depth model and the effects of `options`, in the order in which a calibration puts them. Parameters that
/// both have keep their values.
fn with_model(
    camera: &Camera,
    capture: &CameraFrames<SampledFrame>,
    options: &CameraOptions,
) -> Result<Camera, RegisterError> {
    let options = &options.for_board(&capture.target);
    let domain = seen(capture);
    let is_effect = |b: &Block| b.piece().is_some_and(|p| p.role() == Role::Effect);
    let (pinhole, with_piece): (Vec<Block>, Vec<Block>) =
        camera.blocks().iter().cloned().partition(|b| b.piece().is_none());
    let mut pieces: Vec<Block> = with_piece.into_iter().filter(|b| !is_depth_only(b) && !is_effect(b)).collect();
    let effects = image_blocks(options)?;
    let depth = depth_blocks(options)?.into_iter().map(|block| block.over(&domain));
    for mut block in effects.into_iter().chain(depth) {
        let fitted = camera.block(block.name()).filter(|b| b.theta.len() == block.theta.len());
        for (i, value) in fitted.iter().flat_map(|b| b.theta.iter().enumerate()) {
            if block.free[i] {
                block.theta[i] = *value;
            }
        }
        pieces.push(block);
    }
    let pinhole = pinhole.into_iter().next().unwrap_or_else(|| Block::pinhole([f64::NAN; 5]));
    Ok(Camera::from_blocks(camera.width, camera.height, pinhole, pieces))
}
