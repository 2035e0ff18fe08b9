//! Start values of a rig: cameras alone from their images, places from shared views, one pose of the board per frame.

use std::collections::BTreeMap;

use crate::calibrate::{CalibrateOptions, CalibratedCamera, ImagesAlone, calibrate_image_or_cause, prepare_depth};
use crate::observe::{CameraFrames, DroppedFrame, PosedFrame, SampledFrame};
use depthcal_model::Camera;
use depthcal_model::hook::HookKind;
use nalgebra::Isometry3;
use tracing::warn;

use super::depth_camera_prior::priors_of;
use super::depth_camera_start::{DepthStart, resample_depth_camera, start_depth_camera};
use super::known_extrinsics::take_known;
use crate::adjust::adjustment::Adjustment;
use crate::adjust::state::{CameraState, ParameterPrior, RigFrame, State};
use crate::calibrate::CalibrateError;
use crate::observe::Taken;
use crate::observe::{CameraCapture, Capture};
use crate::start::views::{Node, OffsetEstimate, PairSummary, connect, offset_between};

/// Fewest frames of a camera with a time offset.
const FEWEST_MOVING: usize = 6;
/// Why a time offset is refused.
const NO_MOTION: &str = "fewer than 6 frames that it shares have times and neighbours within 0.35 s before and after them: give timestamp_s, \
                         and capture a video of a board that moves, or leave time_offset out for a board that stands still";

/// The start of an adjustment.
pub(in crate::calibrate) struct Started {
    pub state: State,
    pub pairs: Vec<PairSummary>,
    /// Every camera calibrated before the adjustment of the rig, for the record, and what its images alone say of it.
    pub alone: Vec<(CalibratedCamera, Option<ImagesAlone>)>,
    /// Whether a camera's intrinsics are declared, for those without images.
    pub is_declared: Vec<bool>,
}

/// Calibrates every camera with images alone, connects the cameras, and samples their depth.
pub(in crate::calibrate) fn start(capture: &Capture, options: &CalibrateOptions) -> Result<Started, CalibrateError> {
    let with_images: Vec<_> = capture.cameras.iter().filter(|c| c.has_markers()).collect();
    match (with_images.first(), capture.cameras.first()) {
        (None, _) | (_, None) => return Err(CalibrateError::NoImages { dataset: capture.name.clone() }),
        (Some(with), Some(first)) if with.name != first.name => {
            return Err(CalibrateError::ReferenceWithoutImages { camera: first.name.clone() });
        }
        _ => {}
    }
    let mut from_images: Vec<CalibratedCamera<PosedFrame>> = Vec::new();
    for camera in &with_images {
        let camera_options = options.of(camera)?;
        let from_image = calibrate_image_or_cause(&camera.capture, &camera_options);
        from_images.push(from_image.map_err(CalibrateError::of_camera(&camera.name))?);
    }
    let cameras: Vec<Camera> = from_images.iter().map(|c| c.camera.clone()).collect();
    let offsets = time_offsets(&with_images, &from_images, options)?;
    let nodes = with_images.iter().zip(&cameras).zip(&mut from_images).zip(&offsets);
    let mut nodes: Vec<Node<'_>> = nodes
        .map(|(((capture, camera), alone), offset_s)| Node {
            name: &capture.name,
            camera,
            capture: &mut alone.capture,
            offset_s: *offset_s,
        })
        .collect();
    let mut places = connect(&mut nodes)?;
    drop(nodes);
    for (place, camera) in places.camera_from_rig.iter_mut().zip(&with_images) {
        take_known(place, camera);
    }
    let frames = rig_frames(capture, &from_images, &places.camera_from_rig, &offsets);
    let offsets_are_known = offsets.iter().all(Option::is_none);
    let starts = from_images.into_iter().zip(places.camera_from_rig).zip(offsets);
    let mut of_cameras = Vec::new();
    for (camera, ((from_image, camera_from_rig), offset_s)) in with_images.iter().zip(starts) {
        let lens = (from_image.lens_choice.clone(), from_image.lens_comparison.clone());
        let images_alone = Some(ImagesAlone::of(&from_image));
        let prepared = prepare_depth(from_image, &options.of(camera)?);
        let mut prepared = prepared.map_err(CalibrateError::of_camera(&camera.name))?;
        (prepared.lens_choice, prepared.lens_comparison) = lens;
        let (priors, is_declared) = (Vec::new(), false);
        of_cameras.push(Start { camera, prepared, images_alone, camera_from_rig, priors, offset_s, is_declared });
    }
    let mut state = state_of(&of_cameras, frames, options)?;
    if of_cameras.len() < capture.cameras.len() {
        // Poses by images alone follow a bent board or a wrong lens; depth tells its tilt. Offsets need the board's motion.
        if offsets_are_known {
            Adjustment::of_state(&state, true)?.solve_within(ROUGHLY)?.give(&mut state);
        }
        let poses = poses_by_name(&state.frames);
        for camera in capture.cameras.iter().filter(|camera| !camera.has_markers()) {
            let DepthStart { prepared, camera_from_rig, is_declared } =
                start_depth_camera(camera, &poses, &options.of(camera)?)?;
            let priors = priors_of(&prepared.camera, is_declared);
            let offset_s = is_asked(camera, options).then_some(0.0);
            let images_alone = None;
            of_cameras.push(Start { camera, prepared, images_alone, camera_from_rig, priors, offset_s, is_declared });
        }
        of_cameras.sort_by_key(|start| capture.cameras.iter().position(|camera| camera.name == start.camera.name));
        state = state_of(&of_cameras, state.frames, options)?;
        if offsets_are_known {
            adjust_in_part(&mut state, &of_cameras)?;
            resample(&mut state, &mut of_cameras, options)?;
        }
    }
    drop_frames_without_motion(&mut state)?;
    let is_declared = of_cameras.iter().map(|start| start.is_declared).collect();
    let alone = of_cameras.into_iter().map(|start| (start.prepared, start.images_alone)).collect();
    Ok(Started { state, pairs: places.pairs, alone, is_declared })
}

/// Decrease of the cost by a step below which the adjustment ends whose poses of the board cameras without images get.
const ROUGHLY: f64 = 1e-3;

/// Coefficients of an assumed lens that are free in the first adjustments.
const FIRST_COEFFICIENTS: [usize; 2] = [0, 1];

/// Adjusts the rig roughly, with the lenses that cameras without images are assumed to have held, but for their first
/// coefficients. Before place and focal length are right, a whole lens takes their errors up, and may fold at a pixel, from which
/// no step leads back.
fn adjust_in_part(state: &mut State, starts: &[Start<'_>]) -> Result<(), CalibrateError> {
    let is_assumed = |start: &Start<'_>| !start.camera.has_markers() && !start.is_declared;
    let cameras: Vec<Camera> = starts.iter().map(|start| start.prepared.camera.clone()).collect();
    // Without such a lens there is nothing to free step by step.
    let steps = if starts.iter().any(is_assumed) { FIRST_COEFFICIENTS.len() } else { 1 };
    for count in FIRST_COEFFICIENTS.into_iter().take(steps).map(Some).chain([None]) {
        for ((camera, whole), _) in state.cameras.iter_mut().zip(&cameras).zip(starts).filter(|(_, s)| is_assumed(s)) {
            let mut free = whole.blocks().iter().map(|block| block.free.clone());
            camera.camera = camera.camera.map_blocks(|mut block| {
                block.free = free.next().unwrap_or(block.free);
                if block.hook() == HookKind::Lens {
                    block.free.iter_mut().skip(count.unwrap_or(usize::MAX)).for_each(|free| *free = false);
                }
                block
            });
        }
        if count.is_some() {
            Adjustment::of_state(state, true)?.solve_within(ROUGHLY)?.give(state);
        }
    }
    Ok(())
}

/// Samples the depth of cameras without images anew, where they were adjusted to be.
fn resample(state: &mut State, starts: &mut [Start<'_>], options: &CalibrateOptions) -> Result<(), CalibrateError> {
    let State { frames, cameras } = state;
    let (poses, numbers) = (poses_by_name(frames), numbers_by_name(frames));
    for (camera, start) in cameras.iter_mut().zip(starts).filter(|(_, start)| !start.camera.has_markers()) {
        start.prepared = resample_depth_camera(start.camera, camera, &poses, &options.of(start.camera)?)?;
        start.camera_from_rig = camera.camera_from_rig;
        *camera = camera_state(start, &numbers, options)?;
    }
    state.place_boards();
    Ok(())
}

fn poses_by_name(frames: &[RigFrame]) -> BTreeMap<&str, Isometry3<f64>> {
    frames.iter().map(|frame| (frame.name.as_str(), frame.rig_from_board)).collect()
}

fn numbers_by_name(frames: &[RigFrame]) -> BTreeMap<&str, usize> {
    frames.iter().enumerate().map(|(i, frame)| (frame.name.as_str(), i)).collect()
}

/// A camera before the adjustment of the rig.
struct Start<'a> {
    camera: &'a CameraCapture,
    /// With its depth sampled.
    prepared: CalibratedCamera,
    /// The evidence of its images alone, where it has images.
    images_alone: Option<ImagesAlone>,
    camera_from_rig: Isometry3<f64>,
    priors: Vec<ParameterPrior>,
    offset_s: Option<f64>,
    /// Whether its intrinsics are declared, of one without images.
    is_declared: bool,
}

/// The rig of some cameras, whose frames are among `frames`: the union of the cameras'.
fn state_of(starts: &[Start<'_>], frames: Vec<RigFrame>, options: &CalibrateOptions) -> Result<State, CalibrateError> {
    let numbers = numbers_by_name(&frames);
    let cameras = starts.iter().map(|start| camera_state(start, &numbers, options)).collect::<Result<_, _>>()?;
    Ok(State { frames, cameras })
}

fn camera_state(
    start: &Start<'_>,
    numbers: &BTreeMap<&str, usize>,
    options: &CalibrateOptions,
) -> Result<CameraState, CalibrateError> {
    let Start { camera, prepared, camera_from_rig, priors, offset_s, .. } = start;
    let of_frame = |f: &SampledFrame| numbers.get(f.name.as_str()).copied();
    Ok(CameraState {
        name: camera.name.clone(),
        camera: prepared.camera.clone(),
        camera_from_rig: *camera_from_rig,
        is_placed: camera.camera_from_rig.is_some(),
        drift: None,
        offset_s: *offset_s,
        noise: prepared.noise,
        smoothness: prepared.smoothness.clone(),
        capture: prepared.capture.clone(),
        frames: prepared.capture.frames.iter().filter_map(of_frame).collect(),
        correlation_length_px: prepared.correlation_length_px,
        outliers: prepared.outliers,
        priors: priors.clone(),
        prior: options.of(camera)?.prior,
    })
}

/// Whether the time offset of a camera is to be estimated.
fn is_asked(camera: &CameraCapture, options: &CalibrateOptions) -> bool {
    options.time_offsets.contains(&camera.name)
}

/// Start values of the time offsets that are asked for, s, of the cameras with images; `None` for the others, of which a plain
/// one is proposed: without it their views of a moving board seem to contradict each other.
fn time_offsets(
    cameras: &[&CameraCapture],
    alone: &[CalibratedCamera<PosedFrame>],
    options: &CalibrateOptions,
) -> Result<Vec<Option<f64>>, CalibrateError> {
    let offset = |(number, camera): (usize, &&CameraCapture)| {
        let estimate = (number > 0).then(|| offset_between(&alone[0].capture, &alone[number].capture)).flatten();
        if !is_asked(camera, options) {
            estimate.filter(OffsetEstimate::is_plain).iter().for_each(|e| propose([&camera.name, &cameras[0].name], e));
            return Ok(None);
        }
        let lacking =
            |reason: &str| CalibrateError::TimeOffset { camera: camera.name.clone(), reason: reason.to_owned() };
        if number == 0 {
            return Err(lacking(
                "it is the reference, against whose times those of the other cameras are held: ask for theirs",
            ));
        }
        estimate.map(|estimate| Some(estimate.later_s)).ok_or_else(|| lacking(NO_MOTION))
    };
    cameras.iter().enumerate().map(offset).collect()
}

/// Proposes to estimate the time offset of a camera against the reference.
fn propose([camera, reference]: [&str; 2], estimate: &OffsetEstimate) {
    let OffsetEstimate { later_s, apart_mm, apart_as_timed_mm } = estimate;
    warn!(
        "{camera} exposes {:.1} ms {} than its times say: with that its views of the moving board and those of {reference} are \
         {apart_mm:.2} mm apart, without {apart_as_timed_mm:.2} mm: --with {camera}:time_offset estimates it",
        1e3 * later_s.abs(),
        if *later_s > 0.0 { "later" } else { "earlier" },
    );
}

/// Takes the frames out of cameras with a time offset about which the board's motion is unknown.
fn drop_frames_without_motion(state: &mut State) -> Result<(), CalibrateError> {
    state.take_motions();
    let is_known: Vec<bool> = state.frames.iter().map(|frame| frame.motion.is_some()).collect();
    for camera in state.cameras.iter_mut().filter(|camera| camera.offset_s.is_some()) {
        let keep: Vec<bool> = camera.frames.iter().map(|number| is_known[*number]).collect();
        let without = camera.capture.frames.iter().zip(&keep).filter(|(_, keep)| !**keep);
        let dropped: Vec<DroppedFrame> = without
            .map(|(frame, _)| DroppedFrame {
                name: frame.name.clone(),
                reason: "how the board moves is unknown: no frame is near enough in time before it or after it"
                    .to_owned(),
            })
            .collect();
        camera.capture.dropped.extend(dropped);
        camera.capture = camera.capture.subset(|i, _| keep[i]);
        let mut keep_flags = keep.iter();
        camera.frames.retain(|_| keep_flags.next().is_some_and(|keep| *keep));
        if camera.frames.len() < FEWEST_MOVING {
            return Err(CalibrateError::TimeOffset { camera: camera.name.clone(), reason: NO_MOTION.to_owned() });
        }
    }
    state.place_boards();
    Ok(())
}

/// The frames that any camera has, with the pose of the board by the camera in which most markers were found.
fn rig_frames(
    capture: &Capture,
    cameras: &[CalibratedCamera<PosedFrame>],
    camera_from_rig: &[Isometry3<f64>],
    offsets: &[Option<f64>],
) -> Vec<RigFrame> {
    let mut best: BTreeMap<String, ((bool, usize), RigFrame)> = BTreeMap::new();
    for ((camera, place), offset) in cameras.iter().zip(camera_from_rig).zip(offsets) {
        let posed: &CameraFrames<PosedFrame> = &camera.capture;
        for frame in &posed.frames {
            // A frame is when those cameras see it that need no offset.
            let markers = (offset.is_none(), frame.markers.len());
            let rig_from_board = place.inverse() * frame.camera_from_board;
            let taken = Taken::of(frame);
            let (name, board, metadata) = (frame.name.clone(), frame.board, frame.metadata.clone());
            let rig_frame = || RigFrame { name, rig_from_board, board, metadata, taken, motion: None };
            match best.get(&frame.name) {
                Some((most, _)) if *most >= markers => {}
                _ => _ = best.insert(frame.name.clone(), (markers, rig_frame())),
            }
        }
    }
    capture.frame_names().iter().filter_map(|name| best.remove(name)).map(|(_, frame)| frame).collect()
}
