//! Which frames can be calibrated with: those whose markers determine a pose, and fit it as those of the others do.

use depthcal_model::Camera;
use depthcal_statistics::{rms, upper_median};
use rayon::prelude::*;
use tracing::{info, warn};

use super::error::CalibrateError;
use super::rules::{Attempt, ROUNDS};
use crate::adjust::adjustment::AdjustedCamera;
use crate::adjust::state::CameraState;
use crate::observe::gross_markers::gross_markers;
use crate::observe::wrong_markers::{limit_px, take_wrong};
use crate::observe::{CameraFrames, DetectedFrame, DroppedFrame, MarkerObservation, PosedFrame};
use crate::start::{
    FEWEST_FRAMES, FEWEST_MARKERS, FrameMarkers, PoseFit, StartError, doubt_between, estimate_pose, fit_homography,
    mirrored_pose,
};

/// Frames whose reprojection error exceeds this many times the median are misdetected boards.
const BAD_FRAME_RATIO: f64 = 6.0;
/// … but never those below this error, px.
const BAD_FRAME_FLOOR_PX: f64 = 0.5;

/// The markers of a frame.
pub(super) fn markers_of(frame: &DetectedFrame) -> FrameMarkers<'_> {
    FrameMarkers { name: &frame.name, markers: &frame.markers }
}

/// The capture without grossly wrong markers, of which frames keep a list.
pub(super) fn without_gross_markers(capture: &CameraFrames) -> CameraFrames {
    let without = |frame: &DetectedFrame| {
        let wrong = gross_markers(&capture.target, &frame.markers);
        let count = wrong.iter().filter(|wrong| **wrong).count();
        let mut frame = frame.clone();
        if count > 0 {
            warn!("frame {}: {count} of its {} markers left out, far from all others", frame.name, wrong.len());
            let mut wrong = wrong.iter();
            let gross = frame.markers.extract_if(.., |_| wrong.next().is_some_and(|wrong| *wrong));
            frame.wrong_markers.extend(gross);
        }
        frame
    };
    capture.with_frames(capture.frames.par_iter().map(without).collect())
}

/// The capture without frames whose markers determine no homography, which are among its dropped.
pub(super) fn with_homographies(capture: &CameraFrames) -> CameraFrames {
    let reason = |frame: &DetectedFrame| match fit_homography(&capture.target, &markers_of(frame)) {
        Ok(_) => None,
        Err(StartError::TooFewMarkers { found, .. }) => {
            Some(format!("only {found} markers, but at least {FEWEST_MARKERS} are needed"))
        }
        Err(StartError::Collinear { .. }) => Some(format!(
            "its {} markers lie on a line, which does not determine the board's plane",
            frame.markers.len()
        )),
        Err(other) => Some(other.to_string()),
    };
    let judged = capture.frames.iter().map(|f| (f.clone(), reason(f)));
    keep(
        capture,
        judged.map(|(frame, reason)| reason.map_or_else(|| Ok(frame.clone()), |r| Err((frame.name.clone(), r)))),
    )
}

/// All frames with the poses that they have under a camera; those without are among the dropped.
pub(super) fn posed(capture: &CameraFrames, camera: &Camera) -> CameraFrames<PosedFrame> {
    let pose = |frame: &DetectedFrame| match estimate_pose(camera, &capture.target, &markers_of(frame)) {
        Ok(fit) => Ok(PosedFrame { detected: frame.clone(), camera_from_board: fit.camera_from_board }),
        Err(error) => Err((frame.name.clone(), error.to_string())),
    };
    keep(capture, capture.frames.iter().map(pose))
}

/// The capture with those frames that are kept; names and reasons of the others are among its dropped.
fn keep<F>(capture: &CameraFrames, judged: impl Iterator<Item = Result<F, (String, String)>>) -> CameraFrames<F> {
    let mut remaining = capture.with_frames(Vec::new());
    for frame in judged {
        match frame {
            Ok(frame) => remaining.frames.push(frame),
            Err((name, reason)) => drop_frame(&mut remaining.dropped, name, reason),
        }
    }
    remaining
}

fn drop_frame(dropped: &mut Vec<DroppedFrame>, name: String, reason: String) {
    warn!("frame {name} is dropped: {reason}");
    dropped.push(DroppedFrame { name, reason });
}

/// Leaves mirrored poses, and drops the frame that fits far worse than the others, and those whose markers do not determine
/// their pose; true where anything changed.
pub(super) fn repair(
    Attempt { round, repairs }: Attempt,
    state: &mut CameraState<PosedFrame>,
    adjusted: &AdjustedCamera,
) -> Result<bool, CalibrateError> {
    let distances = distances_px(&state.capture, &adjusted.image_residuals, state.noise.pixel_sigma);
    let errors: Vec<f64> = distances.iter().map(|of_frame| rms(of_frame.iter().copied())).collect();
    // Before a frame is called bad: its pose may only be the wrong one of two. Later rounds change no pose by so much.
    let others = if round == 1 { mirrored_poses(&state.capture, &state.camera) } else { Vec::new() };
    if repairs < ROUNDS && leave_mirrored_poses(&mut state.capture, &others, &errors) > 0 {
        return Ok(true);
    }
    let capture = &mut state.capture;
    let bad = worst_frame(&errors).map(|bad| vec![bad]);
    let bad = bad.unwrap_or_else(|| undetermined_frames(capture, &state.camera, &others, &errors));
    if bad.is_empty() {
        return Ok(leave_out_wrong_markers(capture, &distances) > 0);
    }
    for (place, reason) in bad.into_iter().rev() {
        let frame = capture.frames.remove(place);
        drop_frame(&mut capture.dropped, frame.name.clone(), reason);
    }
    if capture.frames.len() < FEWEST_FRAMES {
        let usable = capture.frames.len();
        return Err(StartError::TooFewFrames { found: usable, needed: FEWEST_FRAMES }.into());
    }
    Ok(true)
}

/// A start camera without lens may put a frame into the wrong one of a plane's two poses, where the adjustment then stays.
/// The other pose of every frame, mirrored about the line of sight; `None` where it has none.
fn mirrored_poses(capture: &CameraFrames<PosedFrame>, camera: &Camera) -> Vec<Option<PoseFit>> {
    let other = |f: &PosedFrame| mirrored_pose(camera, &capture.target, &f.markers, &f.camera_from_board);
    capture.frames.par_iter().map(other).collect()
}

/// A start camera without lens may put a frame into the wrong one of a plane's two poses, where the adjustment then stays.
/// Takes the other poses that fit clearly better than the frames' own do, whose errors are given, px; returns how many.
fn leave_mirrored_poses(capture: &mut CameraFrames<PosedFrame>, others: &[Option<PoseFit>], errors: &[f64]) -> usize {
    const CLEARLY: f64 = 0.9;
    let mut moved = 0;
    for ((frame, other), error) in capture.frames.iter_mut().zip(others).zip(errors) {
        if let Some(other) = other.as_ref().filter(|other| other.rms_px < CLEARLY * error) {
            frame.camera_from_board = other.camera_from_board;
            moved += 1;
        }
    }
    moved
}

/// Distances between markers and their projections, px, frame by frame, from whitened residuals.
fn distances_px(capture: &CameraFrames<PosedFrame>, residuals: &[f64], sigma: f64) -> Vec<Vec<f64>> {
    let mut pairs = residuals.chunks_exact(2);
    let distance = |(marker, pair): (&MarkerObservation, &[f64])| sigma * marker.std_px * pair[0].hypot(pair[1]);
    capture.frames.iter().map(|frame| frame.markers.iter().zip(pairs.by_ref()).map(distance).collect()).collect()
}

/// Leaves out markers that were found in the wrong place, of frames that keep enough of them, given the distances of all from
/// their projections, px; returns how many.
fn leave_out_wrong_markers(capture: &mut CameraFrames<PosedFrame>, distances: &[Vec<f64>]) -> usize {
    let Some(limit) = limit_px(&distances.concat()) else { return 0 };
    let mut count = 0;
    for (frame, distances) in capture.frames.iter_mut().zip(distances) {
        let far = distances.iter().filter(|d| **d > limit).count();
        if far == 0 || frame.markers.len() - far < FEWEST_MARKERS {
            continue;
        }
        let wrong = take_wrong(&mut frame.markers, distances, limit);
        info!("frame {}: {far} of its markers left out, more than {limit:.1} px from the fit", frame.name);
        frame.wrong_markers.extend(wrong);
        count += far;
    }
    count
}

/// The frame that fits far worse than the others, and why it goes.
fn worst_frame(errors: &[f64]) -> Option<(usize, String)> {
    let median = upper_median(&mut errors.to_vec())?;
    let (worst, error) = errors.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1))?;
    let reason = format!(
        "its reprojection error is {error:.2} px where the median frame has {median:.2} px: a misdetected board"
    );
    (*error > BAD_FRAME_FLOOR_PX && *error > BAD_FRAME_RATIO * median).then_some((worst, reason))
}

/// The frames whose markers leave their pose undetermined under the adjusted camera, and why. The markers' standard deviation
/// is that of the median frame.
fn undetermined_frames(
    capture: &CameraFrames<PosedFrame>,
    camera: &Camera,
    others: &[Option<PoseFit>],
    errors: &[f64],
) -> Vec<(usize, String)> {
    let Some(median) = upper_median(&mut errors.to_vec()) else { return Vec::new() };
    let sigma = median / std::f64::consts::SQRT_2;
    let doubt = |(i, (frame, other)): (usize, (&PosedFrame, &Option<PoseFit>))| {
        let (target, markers) = (&capture.target, markers_of(frame));
        let doubt = doubt_between(camera, target, &markers, &frame.camera_from_board, other.as_ref(), sigma)?;
        Some((i, doubt.to_string()))
    };
    let mut all: Vec<(usize, String)> = capture.frames.par_iter().zip(others).enumerate().filter_map(doubt).collect();
    all.sort_by_key(|(i, _)| *i);
    all
}
