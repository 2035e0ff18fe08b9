//! One camera of a rig as a capture of its own, whose board has poses whether or not it has images.

use std::collections::BTreeMap;

use crate::adjust::blocks::is_depth_only;
use crate::calibrate::CameraOptions;
use crate::observe::{CameraFrames, DetectedFrame, MarkerObservation};
use depthcal_model::{Block, Camera, Target};
use nalgebra::{Isometry3, Point3};

use crate::calibrate::{CalibrateOptions, Calibrated, CameraFit};
use crate::diagnose::DiagnoseError;
use crate::observe::CameraCapture;

/// Markers from which on a frame has a pose.
const FEWEST: usize = 8;

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

/// A capture with markers where the board's poses in the camera, by the frames' names, put them in the image. Frames whose board
/// lies outside the image, or that have no pose, are left out.
fn with_projected_markers(
    capture: &CameraFrames,
    camera: &Camera,
    camera_from_board: &BTreeMap<&str, Isometry3<f64>>,
) -> CameraFrames {
    let frame = |frame: &DetectedFrame| {
        let pose = camera_from_board.get(frame.name.as_str())?;
        let markers = projected(camera, pose, &capture.target, frame.board);
        (markers.len() >= FEWEST).then(|| DetectedFrame { markers, ..frame.clone() })
    };
    capture.with_frames(capture.frames.iter().filter_map(frame).collect())
}

fn projected(
    camera: &Camera,
    camera_from_board: &Isometry3<f64>,
    target: &Target,
    board: usize,
) -> Vec<MarkerObservation> {
    let marker = |(index, nominal): (usize, [f64; 2])| {
        let pixel = camera.project(&(camera_from_board * Point3::from(camera.board_point(nominal))).coords)?;
        let (width, height) = (camera.width as f64, camera.height as f64);
        let inside = pixel[0] >= 0.0 && pixel[1] >= 0.0 && pixel[0] <= width - 1.0 && pixel[1] <= height - 1.0;
        inside.then_some(MarkerObservation { index, pixel, std_px: 1.0 })
    };
    target.points_of(board).into_iter().filter_map(marker).collect()
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
