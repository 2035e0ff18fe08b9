//! The driver: the camera from the images, then depth by the estimator asked for.

use std::sync::Arc;

use depthcal_model::{AnyPiece, Block, Modulation, RegisterError, needed_light};
use tracing::info;

use super::calibrated_camera::CalibratedCamera;
use super::camera_options::{CameraOptions, Estimator};
use super::checked_sample::{check_depth, checked_sample, drop_repeated_depth};
use super::error::CalibrateError;
use super::foreign_depth::drop_foreign_depth;
use super::held::hold;
use super::image::calibrate_image_or_cause;
use super::joint::{joint, with_depth_pieces};
use super::marker_estimators::estimate;
use super::model_blocks::depth_blocks;
use crate::observe::{CameraFrames, PosedFrame, SampledFrame};

/// Calibrates a depth camera: markers first, then depth by the estimator asked for.
///
/// # Errors
///
/// [`CalibrateError`]; see [`CalibrateError::is_untrusted_fit`] for which of them speak of the fit.
pub fn calibrate_camera(capture: &CameraFrames, options: &CameraOptions) -> Result<CalibratedCamera, CalibrateError> {
    depth_blocks(options)?;
    let from_image = calibrate_image_or_cause(capture, options)?;
    info!(
        "{} frames, {:.3} px rms from the image alone",
        from_image.capture.frames.len(),
        from_image.reprojection_rms_px
    );
    // The joint adjustment looks at what it samples.
    if options.estimator != Estimator::Joint && from_image.capture.has_depth() {
        check_depth(&from_image.capture, &from_image.camera, options)?;
    }
    calibrate_depth(from_image, options)
}

/// Calibrates a depth camera by the joint adjustment. Returns the fit and the depth samples before any were left out as outliers,
/// from which [`readjust`](super::readjust::readjust) starts.
///
/// # Errors
///
/// [`CalibrateError`]; see [`CalibrateError::is_untrusted_fit`] for which of them speak of the fit.
pub fn calibrate_keeping_samples(
    capture: &CameraFrames,
    options: &CameraOptions,
) -> Result<(CalibratedCamera, CameraFrames<SampledFrame>), CalibrateError> {
    let blocks = depth_blocks(options)?;
    let from_image = calibrate_image_or_cause(capture, options)?;
    let (mut capture, correlation) =
        checked_sample(from_image.capture, &from_image.camera, light(&blocks, options), options)?;
    let foreign_depth = drop_foreign_depth(&mut capture);
    let samples = capture.clone();
    let fit = joint(capture, correlation, from_image.camera, from_image.noise, blocks, options)?;
    let (lens_choice, lens_comparison) = (from_image.lens_choice, from_image.lens_comparison);
    Ok((CalibratedCamera { lens_choice, lens_comparison, foreign_depth, ..fit }, samples))
}

/// Fits the depth model by the estimator asked for, on top of a calibration from the images alone.
///
/// # Errors
///
/// [`CalibrateError`]; see [`CalibrateError::is_untrusted_fit`] for which of them speak of the fit.
pub fn calibrate_depth(
    mut from_image: CalibratedCamera<PosedFrame>,
    options: &CameraOptions,
) -> Result<CalibratedCamera, CalibrateError> {
    let depth_blocks = depth_blocks(options)?;
    if !from_image.capture.has_depth() {
        if options.model.is_none() && depth_blocks.is_empty() {
            return Ok(from_image.without_samples());
        }
        let (dataset, model) = (from_image.capture.name.clone(), options.model.to_string());
        return Err(CalibrateError::NoDepth { dataset, model });
    }
    match options.estimator {
        Estimator::Joint => {
            let CalibratedCamera { capture, camera, noise, lens_choice, lens_comparison, .. } = from_image;
            let (mut capture, correlation) = checked_sample(capture, &camera, light(&depth_blocks, options), options)?;
            let foreign_depth = drop_foreign_depth(&mut capture);
            let fit = joint(capture, correlation, camera, noise, depth_blocks, options)?;
            Ok(CalibratedCamera { lens_choice, lens_comparison, foreign_depth, ..fit })
        }
        other => {
            drop_repeated_depth(&mut from_image.capture);
            let _stage = options.progress.stage("estimating D from markers");
            estimate(from_image, depth_blocks, other)
        }
    }
}

/// A calibration from the images alone with sampled depth and the depth pieces at their nominal values, not yet adjusted: what a
/// joint adjustment of several cameras starts from. Without depth, and for fields, it is what [`calibrate_depth`] gives: fields
/// need the search for their roughness.
///
/// # Errors
///
/// As [`calibrate_depth`].
pub fn prepare_depth(
    from_image: CalibratedCamera<PosedFrame>,
    options: &CameraOptions,
) -> Result<CalibratedCamera, CalibrateError> {
    let blocks = depth_blocks(options)?;
    let are_fields = blocks.iter().any(|b| b.piece().is_some_and(|p| p.field().is_some()));
    if are_fields || !from_image.capture.has_depth() || options.estimator != Estimator::Joint {
        return calibrate_depth(from_image, options);
    }
    let (mut sampled, correlation) =
        checked_sample(from_image.capture.clone(), &from_image.camera, light(&blocks, options), options)?;
    let foreign_depth = drop_foreign_depth(&mut sampled);
    let (camera, noise) = with_depth_pieces(&sampled, from_image.camera.clone(), from_image.noise, blocks);
    let mut prepared = from_image.without_samples();
    (prepared.capture, prepared.noise, prepared.foreign_depth) = (sampled, noise, foreign_depth);
    prepared.camera = hold(&camera, &options.held, true);
    (prepared.with_depth, prepared.covariance, prepared.correlation_length_px) = (true, None, correlation);
    Ok(prepared)
}

/// The modulation frequencies for which the samples of a fit of these options have the light of their frames; `None` where they
/// need none.
///
/// # Errors
///
/// [`RegisterError`] where an effect or the depth model is unknown.
pub fn light_of_samples(options: &CameraOptions) -> Result<Option<Modulation>, RegisterError> {
    Ok(light(&depth_blocks(options)?, options))
}

/// The modulation frequencies for which samples need the light of their frames: those of the model, else of a piece that a search
/// may add.
fn light(blocks: &[Block], options: &CameraOptions) -> Option<Modulation> {
    let register = &options.register;
    let mut pieces: Vec<Arc<dyn AnyPiece>> = blocks.iter().filter_map(|b| b.piece().cloned()).collect();
    if options.samples_for_search {
        pieces.extend(register.names().filter_map(|name| register.find(name)));
    }
    needed_light(pieces.iter().map(|p| &**p))
}
