//! One camera of a rig as a capture of its own, whose board has poses whether or not it has images.

use std::collections::BTreeMap;

use crate::adjust::blocks::is_depth_only;
use crate::calibrate::CameraOptions;
use crate::observe::CameraFrames;
use crate::observe::projected_markers::with_projected_markers;
use depthcal_model::{Block, Camera};
use nalgebra::Isometry3;

use crate::calibrate::{CalibrateOptions, Calibrated, CameraFit};
use crate::diagnose::DiagnoseError;
use crate::observe::CameraCapture;

/// The frames of a camera that the rig's calibration used. Those of a camera without images have markers where the rig's poses
/// put them in its image ([`with_projected_markers`]).
fn alone(capture: &CameraCapture, fit: &CameraFit, rig: &Calibrated) -> CameraFrames {
    let used = |name: &str| fit.calibrated.capture.frames.iter().any(|f| f.name == name);
    let used_frames = capture.capture.subset(|_, frame| used(&frame.name));
    if fit.has_markers() {
        return used_frames;
    }
    let poses: BTreeMap<&str, Isometry3<f64>> =
        rig.frames.iter().map(|f| (f.name.as_str(), fit.camera_from_rig * f.rig_from_board)).collect();
    with_projected_markers(&used_frames, &fit.calibrated.camera, &poses)
}

/// Frames and options with which a camera is examined alone. A camera without images keeps pinhole and lens of the
/// rig's fit. `None` where the rig's fit lacks the camera.
///
/// # Errors
///
/// [`DiagnoseError::Camera`] where an effect is unknown.
pub fn examined(
    capture: &CameraCapture,
    rig: &Calibrated,
    options: &CalibrateOptions,
) -> Result<Option<(CameraFrames, CameraOptions)>, DiagnoseError> {
    let Some(fit) = rig.camera(&capture.name) else { return Ok(None) };
    let mut calibrate = options.of(capture)?;
    if !fit.has_markers() {
        let held = held_image_pieces(&fit.calibrated.camera);
        calibrate.effects.retain(|effect| held.block(&effect.name).is_none());
        calibrate.camera = Some(held);
    }
    Ok(Some((alone(capture, fit, rig), calibrate)))
}

/// Pinhole and lens of a camera, held: what projected markers cannot tell again.
fn held_image_pieces(camera: &Camera) -> Camera {
    let held = |block: &Block| {
        let mut block = block.clone();
        block.free.iter_mut().for_each(|free| *free = false);
        block
    };
    let (pinhole, pieces): (Vec<Block>, Vec<Block>) =
        camera.blocks().iter().filter(|b| !is_depth_only(b)).map(held).partition(|block| block.piece().is_none());
    let pinhole = pinhole.into_iter().next().unwrap_or_else(|| Block::pinhole(camera.pinhole()));
    Camera::from_blocks(camera.width, camera.height, pinhole, pieces)
}
