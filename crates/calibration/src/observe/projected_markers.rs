//! Markers of a camera without images, where poses of its board put them.

use std::collections::BTreeMap;

use depthcal_io::{DroppedFrame, MarkerObservation};
use depthcal_model::{Camera, Target};
use nalgebra::{Isometry3, Point3};

use super::{CameraFrames, DetectedFrame};

/// Why a frame of a camera without images has no pose.
pub(crate) const NOT_SHOWN: &str = "no other camera shows where its board is";
/// Markers from which on a frame has a pose.
const FEWEST: usize = 8;

/// A capture with markers where the board's poses in the camera, by the frames' names, put them in the image. Frames that have no
/// pose, or whose board lies outside the image, are dropped with the reason.
pub(crate) fn with_projected_markers(
    capture: &CameraFrames,
    camera: &Camera,
    camera_from_board: &BTreeMap<&str, Isometry3<f64>>,
) -> CameraFrames {
    let with_markers = |frame: &DetectedFrame| {
        let pose = camera_from_board.get(frame.name.as_str()).ok_or(NOT_SHOWN)?;
        let markers = projected(camera, pose, &capture.target, frame.board);
        match markers.len() >= FEWEST {
            true => Ok(DetectedFrame { markers, markers_are_projected: true, ..frame.clone() }),
            false => Err("its board, which other cameras see, is outside of its image"),
        }
    };
    let mut placed = capture.with_frames(Vec::with_capacity(capture.frames.len()));
    for frame in &capture.frames {
        match with_markers(frame) {
            Ok(frame) => placed.frames.push(frame),
            Err(reason) => placed.dropped.push(DroppedFrame { name: frame.name.clone(), reason: reason.to_owned() }),
        }
    }
    placed
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
