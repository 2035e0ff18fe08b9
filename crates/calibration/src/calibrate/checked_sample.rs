//! Depth samples of a capture whose depth is what it is declared to be.

use depthcal_model::{Camera, Modulation};
use rayon::prelude::*;
use tracing::warn;

use super::camera_options::CameraOptions;
use super::depth_scale::{check_one_unit, depth_offset, implausible_scale, is_beyond_any_camera, scale_hint};
use super::error::CalibrateError;
use super::joint::sample;
use super::range_limit::drop_clipped;
use crate::adjust::blocks::is_depth_only;
use crate::cause::{DepthFinding, examine_depth};
use crate::observe::{CameraFrames, DetectedFrame, DroppedFrame, MeasuredDepth, PosedFrame, RawFrame, SampledFrame};
use crate::start::{FEWEST_FRAMES, FrameMarkers, estimate_pose};

/// [`sample`], where depth does not contradict the boards that the images show; without frames whose depth is that of another
/// image.
///
/// # Errors
///
/// [`CalibrateError::Depth`] with the cause, [`CalibrateError::DepthUnexplained`], [`CalibrateError::Scale`], and of [`sample`].
pub(super) fn checked_sample(
    mut capture: CameraFrames<PosedFrame>,
    camera: &Camera,
    light: Option<Modulation>,
    options: &CameraOptions,
) -> Result<(CameraFrames<SampledFrame>, Option<usize>), CalibrateError> {
    drop_repeated_depth(&mut capture);
    sample_if_right(capture, camera, light, options)
}

/// [`sample`], where depth does not contradict the boards that the images show.
fn sample_if_right(
    capture: CameraFrames<PosedFrame>,
    camera: &Camera,
    light: Option<Modulation>,
    options: &CameraOptions,
) -> Result<(CameraFrames<SampledFrame>, Option<usize>), CalibrateError> {
    check_any_measurement(&capture)?;
    let finding = examine_depth(&capture, camera)?;
    if let DepthFinding::Cause(cause) = finding {
        if !cause.is_range_only() {
            return Err(CalibrateError::Depth(Box::new(cause)));
        }
        warn!("{cause}");
        return sampled_in_scale(capture, camera, light, options);
    }
    let sampled = sampled_in_scale(capture, camera, light, options);
    match (sampled, finding) {
        // Where depth fits at no scale, none would help.
        (
            Err(CalibrateError::Scale(_) | CalibrateError::NoDepthOnBoard { .. }),
            DepthFinding::Unexplained(deviation),
        ) if deviation.is_finite() => Err(CalibrateError::DepthUnexplained { deviation }),
        (sampled, _) => sampled,
    }
}

/// Drops frames whose depth is, to the bit, that of an earlier frame with another image: it was recorded at a lower rate.
pub(super) fn drop_repeated_depth(capture: &mut CameraFrames<PosedFrame>) {
    let mut with_own: Vec<PosedFrame> = Vec::with_capacity(capture.frames.len());
    let mut dropped = Vec::new();
    for frame in std::mem::take(&mut capture.frames) {
        let is_same = |earlier: &&PosedFrame| {
            earlier.detected.has_depth_of(&frame.detected) && earlier.detected.markers != frame.detected.markers
        };
        match with_own.iter().find(is_same).map(|earlier| earlier.detected.name.clone()) {
            Some(earlier) => dropped.push(DroppedFrame {
                name: frame.detected.name.clone(),
                reason: format!("its depth image is that of frame {earlier}, though its image is another: one of the two has no depth of its own"),
            }),
            None => with_own.push(frame),
        }
    }
    capture.frames = with_own;
    if let Some(first) = dropped.first() {
        warn!(
            "{}: {} of {} frames are dropped, such as {}: {}; record depth as often as images, or leave out frames without depth of their own",
            capture.name,
            dropped.len(),
            dropped.len() + capture.frames.len(),
            first.name,
            first.reason
        );
    }
    capture.dropped.extend(dropped);
}

/// Holds the depth of a capture as it is declared against the boards that the images show.
///
/// # Errors
///
/// As [`checked_sample`].
pub(super) fn check_depth(
    capture: &CameraFrames<PosedFrame>,
    camera: &Camera,
    options: &CameraOptions,
) -> Result<(), CalibrateError> {
    sample_if_right(capture.clone(), camera, None, options).map(drop)
}

/// Holds the depth of a capture that a calibrated camera is evaluated on against the boards that its images show. Fewer frames
/// than a calibration needs say nothing.
///
/// # Errors
///
/// [`CalibrateError::Depth`] with the cause, [`CalibrateError::DepthUnexplained`], [`CalibrateError::Scale`],
/// [`CalibrateError::NoDepthOnBoard`].
pub fn check_declared_depth(
    camera: &Camera,
    capture: &CameraFrames,
    options: &CameraOptions,
) -> Result<(), CalibrateError> {
    if !capture.has_depth() {
        return Ok(());
    }
    let bare = camera.filtered(|block| !is_depth_only(block));
    let posed = |frame: &DetectedFrame| {
        let markers = FrameMarkers { name: &frame.name, markers: &frame.markers };
        let camera_from_board = estimate_pose(&bare, &capture.target, &markers).ok()?.camera_from_board;
        Some(PosedFrame { detected: frame.clone(), camera_from_board })
    };
    let posed: Vec<PosedFrame> = capture.frames.par_iter().filter_map(posed).collect();
    if posed.len() < FEWEST_FRAMES {
        return Ok(());
    }
    check_depth(&capture.with_frames(posed), &bare, options)
}

/// Refuses depth images none of which has a measurement anywhere.
fn check_any_measurement(capture: &CameraFrames<PosedFrame>) -> Result<(), CalibrateError> {
    let raw = capture.frames.iter().map(|frame| &frame.detected.raw);
    let with_depth: Vec<&RawFrame> = raw.filter(|raw| !matches!(raw.depth, MeasuredDepth::None)).collect();
    let is_empty = |raw: &&RawFrame| matches!(raw.depth, MeasuredDepth::Image(_)) && raw.depth_digest.is_none();
    match !with_depth.is_empty() && with_depth.iter().all(is_empty) {
        true => Err(CalibrateError::NoMeasurement { dataset: capture.name.clone(), frames: with_depth.len() }),
        false => Ok(()),
    }
}

/// Refuses a scale that nothing but a wrong declaration explains, and an offset as large.
fn check_scale(capture: &CameraFrames<SampledFrame>) -> Result<(), CalibrateError> {
    if !is_beyond_any_camera(capture) {
        return Ok(());
    }
    let scale = || implausible_scale(capture, 0.0).map(CalibrateError::from);
    depth_offset(capture).map(CalibrateError::from).or_else(scale).map_or(Ok(()), Err)
}

fn sampled_in_scale(
    capture: CameraFrames<PosedFrame>,
    camera: &Camera,
    light: Option<Modulation>,
    options: &CameraOptions,
) -> Result<(CameraFrames<SampledFrame>, Option<usize>), CalibrateError> {
    let (mut sampled, correlation) = sample(capture, camera, light, options)?;
    drop_clipped(&mut sampled)?;
    check_one_unit(&sampled)?;
    check_scale(&sampled)?;
    if let Some(hint) = scale_hint(&sampled) {
        warn!("{hint}");
    }
    Ok((sampled, correlation))
}
