//! The start of a depth camera without images.

use std::collections::{BTreeMap, BTreeSet};

use crate::adjust::blocks::is_depth_only;
use crate::adjust::smoothness_prior::Smoothness;
use crate::adjust::state::CameraState;
use crate::calibrate::{AUTO, CalibratedCamera, CameraOptions, image_blocks, lens_named, prepare_depth};
use crate::observe::noise::{DepthNoise, NoiseModel, PlaneScatter};
use crate::observe::projected_markers::NOT_SHOWN;
use crate::observe::{CameraFrames, DetectedFrame, DroppedFrame, MarkerObservation, PosedFrame};
use depthcal_model::Camera;
use depthcal_model::hook::HookKind;
use nalgebra::Isometry3;
use tracing::info;
use tracing::subscriber::{NoSubscriber, with_default};

use super::known_extrinsics::take_known;
use crate::calibrate::CalibrateError;
use crate::observe::CameraCapture;
use crate::start::depth_only::{BoardPlaneSeen, place_from_planes, planes_of};

/// The lens where none is asked for; `none` asks for none.
const DEFAULT_LENS: &str = "brown_conrady";
/// Fewest frames with a plane.
const FEWEST_FRAMES: usize = 5;

/// A depth camera with its samples, not yet adjusted.
#[derive(Debug, Clone)]
pub struct DepthStart {
    /// Camera, frames with samples, noise; its frames have no markers.
    pub prepared: CalibratedCamera,
    /// Its place.
    pub camera_from_rig: Isometry3<f64>,
    /// Whether its intrinsics are declared, rather than assumed.
    pub is_declared: bool,
}

/// Starts a depth camera without images from the planes of its frames, given the poses of the board in the rig's frame by name.
///
/// # Errors
///
/// [`CalibrateError::DepthStart`] where planes are lacking or parallel, [`CalibrateError::Camera`] where no depth lies on the
/// boards.
pub fn start_depth_camera(
    camera: &CameraCapture,
    rig_from_board: &BTreeMap<&str, Isometry3<f64>>,
    options: &CameraOptions,
) -> Result<DepthStart, CalibrateError> {
    let lacking = |reason: String| CalibrateError::DepthStart { camera: camera.name.clone(), reason };
    let capture = &camera.capture;
    let common = capture.subset(|_, frame| rig_from_board.contains_key(frame.name.as_str()));
    let unit_mm = capture.depth_unit_mm.unwrap_or(1.0);
    // Which of several boards a plane is cannot be told from depth alone: the start is from frames that show one.
    let several = frames_of_several_boards(&common);
    let of_start = common.subset(|_, frame| !several.contains(frame.name.as_str()));
    let planes = planes_of(&of_start.frames, (capture.width, capture.height), unit_mm)?;
    let with_plane: Vec<_> = of_start.frames.iter().zip(&planes).filter_map(|(f, p)| Some((f, (*p)?))).collect();
    if with_plane.len() < FEWEST_FRAMES {
        return Err(lacking(format!(
            "only {} of {} frames in which other cameras see one board show a plane in front of the scene: {FEWEST_FRAMES} are needed; check that \
             frames are paired, and move the board",
            with_plane.len(),
            of_start.frames.len()
        )));
    }
    let seen: Vec<BoardPlaneSeen> = with_plane
        .iter()
        .map(|(frame, image)| BoardPlaneSeen { image: *image, rig_from_board: rig_from_board[frame.name.as_str()] })
        .collect();
    let declared_focal = camera.declared.as_ref().map(|c| c.pinhole()[0]);
    let mut place = place_from_planes(&seen, capture.width, declared_focal).ok_or_else(|| {
        lacking(
            "its boards are parallel, which leaves its place open: tilt the board by 20° to 45° about both axes"
                .to_owned(),
        )
    })?;
    info!(
        "{}: focal length {:.0} px, normals of {} planes agree to {:.2}°",
        camera.name,
        place.focal_px,
        place.agreeing.iter().filter(|a| **a).count(),
        place.angle_rad.to_degrees()
    );
    take_known(&mut place.camera_from_rig, camera);
    let start = match &camera.declared {
        Some(declared) => declared.clone(),
        None => {
            let f = place.focal_px;
            let middle = [(capture.width as f64 - 1.0) / 2.0, (capture.height as f64 - 1.0) / 2.0];
            // Planes alone cannot choose among lenses: their priors hold what they leave open.
            let lens = camera.lens.as_deref().filter(|lens| *lens != AUTO).unwrap_or(DEFAULT_LENS);
            let lens =
                lens_named(lens, &options.register).map_err(|e| CalibrateError::of_camera(&camera.name)(e.into()))?;
            let pinhole = [f, f, middle[0], middle[1], 0.0];
            Camera::new(capture.width, capture.height, pinhole, lens.into_iter().collect())
        }
    };
    // All cameras see the same board.
    let effects = image_blocks(options).map_err(|e| CalibrateError::of_camera(&camera.name)(e.into()))?;
    let of_board = effects.into_iter().filter(|block| block.hook() == HookKind::Board);
    let start = of_board.fold(start, |start, block| start.with_block(block));
    let agreeing: Vec<&str> = with_plane
        .iter()
        .zip(&place.agreeing)
        .filter(|(_, agrees)| **agrees)
        .map(|((frame, _), _)| frame.name.as_str())
        .chain(several.iter().copied())
        .collect();
    let mut roughly_placed = common.subset(|_, frame| agreeing.contains(&frame.name.as_str()));
    for frame in common.frames.iter().filter(|frame| !agreeing.contains(&frame.name.as_str())) {
        let reason = "its depth shows no plane where other cameras see the board".to_owned();
        roughly_placed.dropped.push(DroppedFrame { name: frame.name.clone(), reason });
    }
    // Without time offsets all frames are sampled again once the camera is adjusted. At a rough place nothing is said of frames;
    // those that stay dropped are listed.
    let prepared = with_default(NoSubscriber::new(), || {
        sampled(&roughly_placed, &start, &place.camera_from_rig, rig_from_board, options)
    })
    .map_err(CalibrateError::of_camera(&camera.name))?;
    Ok(DepthStart { prepared, camera_from_rig: place.camera_from_rig, is_declared: camera.declared.is_some() })
}

/// Names of the frames that are about one of several boards in one depth image.
fn frames_of_several_boards(capture: &CameraFrames) -> BTreeSet<&str> {
    let parts = capture.target.parts();
    let of_image = |frame: &DetectedFrame| {
        parts.get(frame.board).map_or(frame.name.as_str(), |part| part.image_name(&frame.name)).to_owned()
    };
    let mut boards: BTreeMap<String, usize> = BTreeMap::new();
    capture.frames.iter().for_each(|frame| *boards.entry(of_image(frame)).or_default() += 1);
    capture.frames.iter().filter(|frame| boards[&of_image(frame)] > 1).map(|frame| frame.name.as_str()).collect()
}

/// Samples the depth of all frames anew, as seen by a camera that was adjusted from its start: which frames agree with a rough
/// place says little of them.
///
/// # Errors
///
/// [`CalibrateError::Camera`] where no depth lies on the boards.
pub fn resample_depth_camera(
    camera: &CameraCapture,
    adjusted: &CameraState,
    rig_from_board: &BTreeMap<&str, Isometry3<f64>>,
    options: &CameraOptions,
) -> Result<CalibratedCamera, CalibrateError> {
    let of_image = adjusted.camera.filtered(|block| !is_depth_only(block));
    let prepared = sampled(&camera.capture, &of_image, &adjusted.camera_from_rig, rig_from_board, options)
        .map_err(CalibrateError::of_camera(&camera.name))?;
    Ok(CalibratedCamera { camera: adjusted.camera.clone(), ..prepared })
}

/// Samples the depth of frames within the board as the other cameras see it.
fn sampled(
    capture: &CameraFrames,
    camera: &Camera,
    camera_from_rig: &Isometry3<f64>,
    rig_from_board: &BTreeMap<&str, Isometry3<f64>>,
    options: &CameraOptions,
) -> Result<CalibratedCamera, CalibrateError> {
    // The region that is sampled is that of the frame's markers: here the whole board.
    let whole = |index: usize| MarkerObservation { index, pixel: [f64::NAN; 2], std_px: 1.0 };
    let posed = capture.frames.iter().filter_map(|frame| {
        let pose = rig_from_board.get(frame.name.as_str())?;
        let mut detected = frame.clone();
        detected.markers = capture.target.points_of(frame.board).into_iter().map(|(index, _)| whole(index)).collect();
        Some(PosedFrame { detected, camera_from_board: camera_from_rig * pose })
    });
    let start = CalibratedCamera {
        foreign_depth: Vec::new(),
        capture: capture.with_frames(posed.collect()),
        camera: camera.clone(),
        covariance: None,
        noise: NoiseModel {
            pixel_sigma: 1.0,
            depth: DepthNoise { a_per_mm: 1e-5, b_mm: 0.0 },
            planes: PlaneScatter::NONE,
        },
        with_depth: true,
        correlation_length_px: None,
        outliers: 0,
        lens_choice: None,
        lens_comparison: None,
        prior: None,
        smoothness: Smoothness::default(),
        reprojection_rms_px: 0.0,
        depth_rms_mm: None,
        cost: 0.0,
        iterations: 0,
        termination: String::new(),
        estimator: options.estimator,
        model: options.model.clone(),
    };
    let mut prepared = prepare_depth(start, options)?;
    for frame in &mut prepared.capture.frames {
        frame.posed.detected.markers.clear();
    }
    prepared.capture.frames.retain(|frame| !frame.samples.is_empty());
    for frame in &capture.frames {
        let is_known = prepared.capture.frames.iter().any(|known| known.name == frame.name)
            || prepared.capture.dropped.iter().any(|known| known.name == frame.name);
        if !is_known {
            let reason = match rig_from_board.contains_key(frame.name.as_str()) {
                true => "no depth was measured where other cameras see the board",
                false => NOT_SHOWN,
            };
            prepared.capture.dropped.push(DroppedFrame { name: frame.name.clone(), reason: reason.to_owned() });
        }
    }
    Ok(prepared)
}
