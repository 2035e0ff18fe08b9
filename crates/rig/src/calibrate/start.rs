//! Start values of a rig: cameras alone from their images, places from shared views, one pose of the board per frame.

use std::collections::BTreeMap;

use depthcal_calibration::calibrate::{Calibrated, calibrate_image, prepare_depth};
use depthcal_calibration::observe::{Capture, PosedFrame};
use depthcal_model::Camera;
use nalgebra::Isometry3;

use super::options::RigOptions;
use crate::capture::RigCapture;
use crate::depth_only::{DepthStart, priors_of, start_depth_camera};
use crate::drift::Taken;
use crate::error::RigError;
use crate::state::{CameraState, RigFrame, RigState};
use crate::views::{Node, PairSummary, connect};

/// The start of an adjustment.
pub(super) struct Started {
    pub state: RigState,
    pub pairs: Vec<PairSummary>,
    /// What the images alone gave for every camera; for the record.
    pub alone: Vec<Calibrated>,
    /// Whether a camera's intrinsics are declared, for those without images.
    pub is_declared: Vec<bool>,
}

/// Calibrates every camera with images alone, connects the cameras, and samples their depth.
pub(super) fn start(capture: &RigCapture, options: &RigOptions) -> Result<Started, RigError> {
    let with_images: Vec<_> = capture.cameras.iter().filter(|c| c.has_markers()).collect();
    match (with_images.first(), capture.cameras.first()) {
        (None, _) | (_, None) => return Err(RigError::NoImages { rig: capture.name.clone() }),
        (Some(with), Some(first)) if with.name != first.name => {
            return Err(RigError::ReferenceWithoutImages { camera: first.name.clone() });
        }
        _ => {}
    }
    let mut from_images: Vec<Calibrated<PosedFrame>> = Vec::new();
    for camera in &with_images {
        let own = options.of(camera)?;
        from_images.push(calibrate_image(&camera.capture, &own).map_err(RigError::of(&camera.name))?);
    }
    let cameras: Vec<Camera> = from_images.iter().map(|c| c.camera.clone()).collect();
    let nodes = with_images.iter().zip(&cameras).zip(&mut from_images);
    let mut nodes: Vec<Node<'_>> = nodes
        .map(|((capture, camera), alone)| Node { name: &capture.name, camera, capture: &mut alone.capture })
        .collect();
    let places = connect(&mut nodes)?;
    drop(nodes);
    let frames = rig_frames(capture, &from_images, &places.camera_from_rig);
    let number: BTreeMap<&str, usize> = frames.iter().enumerate().map(|(i, f)| (f.name.as_str(), i)).collect();
    let rig_from_board: BTreeMap<&str, Isometry3<f64>> =
        frames.iter().map(|f| (f.name.as_str(), f.rig_from_board)).collect();
    let mut with_images = from_images.into_iter().zip(places.camera_from_rig);
    let (mut states, mut alone, mut is_declared) = (Vec::new(), Vec::new(), Vec::new());
    for camera in &capture.cameras {
        let own = options.of(camera)?;
        let (prepared, camera_from_rig, priors) = if camera.has_markers() {
            // As many as there are cameras with markers.
            let Some((from_image, place)) = with_images.next() else { break };
            let lens = (from_image.lens_choice.clone(), from_image.lens_comparison.clone());
            let mut prepared = prepare_depth(from_image, &own).map_err(RigError::of(&camera.name))?;
            (prepared.lens_choice, prepared.lens_comparison) = lens;
            is_declared.push(false);
            (prepared, place, Vec::new())
        } else {
            let DepthStart { prepared, camera_from_rig, is_declared: declared } =
                start_depth_camera(camera, &rig_from_board, &own)?;
            let priors = priors_of(&prepared.camera, declared);
            is_declared.push(declared);
            (prepared, camera_from_rig, priors)
        };
        let place = |f: &depthcal_calibration::observe::SampledFrame| number.get(f.name.as_str()).copied();
        // Every frame of a camera is among the rig's, whose frames are the union of the cameras'.
        let of_frames: Vec<usize> = prepared.capture.frames.iter().filter_map(place).collect();
        states.push(CameraState {
            name: camera.name.clone(),
            camera: prepared.camera.clone(),
            camera_from_rig,
            drift: None,
            noise: prepared.noise,
            smoothness: prepared.smoothness.clone(),
            capture: prepared.capture.clone(),
            frames: of_frames,
            correlation_length_px: prepared.correlation_length_px,
            outliers: prepared.outliers,
            priors,
        });
        alone.push(prepared);
    }
    Ok(Started { state: RigState { frames, cameras: states }, pairs: places.pairs, alone, is_declared })
}

/// The frames that any camera has, with the pose of the board by the camera in which most markers were found.
fn rig_frames(
    capture: &RigCapture,
    cameras: &[Calibrated<PosedFrame>],
    camera_from_rig: &[Isometry3<f64>],
) -> Vec<RigFrame> {
    let mut best: BTreeMap<String, (usize, RigFrame)> = BTreeMap::new();
    for (camera, place) in cameras.iter().zip(camera_from_rig) {
        let own: &Capture<PosedFrame> = &camera.capture;
        for frame in &own.frames {
            let markers = frame.markers.len();
            let rig_from_board = place.inverse() * frame.camera_from_board;
            let taken = Taken::of(frame);
            let (name, metadata) = (frame.name.clone(), frame.metadata.clone());
            let rig_frame = || RigFrame { name, rig_from_board, metadata, taken };
            match best.get(&frame.name) {
                Some((most, _)) if *most >= markers => {}
                _ => _ = best.insert(frame.name.clone(), (markers, rig_frame())),
            }
        }
    }
    capture.frame_names().iter().filter_map(|name| best.remove(name)).map(|(_, frame)| frame).collect()
}
