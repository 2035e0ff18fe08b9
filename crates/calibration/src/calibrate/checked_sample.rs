//! Depth samples of a capture whose depth is what it is declared to be.

use depthcal_model::{Camera, Modulation};
use tracing::warn;

use super::camera_options::CameraOptions;
use super::depth_scale::{check_scale, scale_hint};
use super::error::CalibrateError;
use super::joint::sample;
use crate::cause::{DepthFinding, examine_depth};
use crate::observe::{CameraFrames, PosedFrame, SampledFrame};

/// [`sample`], where depth does not contradict the boards that the images show.
///
/// # Errors
///
/// [`CalibrateError::Depth`] with the cause, [`CalibrateError::DepthUnexplained`], [`CalibrateError::Scale`], and of [`sample`].
pub(super) fn checked_sample(
    capture: CameraFrames<PosedFrame>,
    camera: &Camera,
    light: Option<Modulation>,
    options: &CameraOptions,
) -> Result<(CameraFrames<SampledFrame>, Option<usize>), CalibrateError> {
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

fn sampled_in_scale(
    capture: CameraFrames<PosedFrame>,
    camera: &Camera,
    light: Option<Modulation>,
    options: &CameraOptions,
) -> Result<(CameraFrames<SampledFrame>, Option<usize>), CalibrateError> {
    let (sampled, correlation) = sample(capture, camera, light, options)?;
    check_scale(&sampled)?;
    if let Some(hint) = scale_hint(&sampled) {
        warn!("{hint}");
    }
    Ok((sampled, correlation))
}
