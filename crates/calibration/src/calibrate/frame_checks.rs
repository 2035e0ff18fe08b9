//! Which frames can be calibrated with: those whose markers determine a pose, and fit it as those of the others do.

use depthcal_model::Camera;
use depthcal_statistics::upper_median;
use nalgebra::Isometry3;
use rayon::prelude::*;
use tracing::warn;

use super::error::CalibrateError;
use super::settle::{ROUNDS, State};
use crate::adjust::adjustment::Adjusted;
use crate::observe::{Capture, DetectedFrame, DroppedFrame, PosedFrame};
use crate::start::{
    FEWEST_FRAMES, FEWEST_MARKERS, FrameMarkers, StartError, estimate_pose, fit_homography, pose_doubt, refine_pose,
};

/// Frames whose reprojection error exceeds this many times the median are misdetected boards.
const BAD_FRAME_RATIO: f64 = 6.0;
/// … but never those below this error, px.
const BAD_FRAME_FLOOR_PX: f64 = 0.5;

/// The markers of a frame.
pub(super) fn markers_of(frame: &DetectedFrame) -> FrameMarkers<'_> {
    FrameMarkers { name: &frame.name, markers: &frame.markers }
}

/// The capture without frames whose markers determine no homography, which are among its dropped.
pub(super) fn with_homographies(capture: &Capture) -> Capture {
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
pub(super) fn posed(capture: &Capture, camera: &Camera) -> Capture<PosedFrame> {
    let pose = |frame: &DetectedFrame| match estimate_pose(camera, &capture.target, &markers_of(frame)) {
        Ok(fit) => Ok(PosedFrame { detected: frame.clone(), camera_from_board: fit.camera_from_board }),
        Err(error) => Err((frame.name.clone(), error.to_string())),
    };
    keep(capture, capture.frames.iter().map(pose))
}

/// The capture with those frames that are kept; names and reasons of the others are among its dropped.
fn keep<F>(capture: &Capture, judged: impl Iterator<Item = Result<F, (String, String)>>) -> Capture<F> {
    let mut kept = capture.with_frames(Vec::new());
    for frame in judged {
        match frame {
            Ok(frame) => kept.frames.push(frame),
            Err((name, reason)) => drop_frame(&mut kept.dropped, name, reason),
        }
    }
    kept
}

fn drop_frame(dropped: &mut Vec<DroppedFrame>, name: String, reason: String) {
    warn!("frame {name} is dropped: {reason}");
    dropped.push(DroppedFrame { name, reason });
}

/// Leaves mirrored poses, and drops the frame that fits far worse than the others, and those whose markers do not determine
/// their pose; true where anything changed.
pub(super) fn repair(round: usize, state: &mut State<PosedFrame>, adjusted: &Adjusted) -> Result<bool, CalibrateError> {
    // Before a frame is called bad: its pose may only be the wrong one of two.
    if round <= ROUNDS && leave_mirrored_poses(&mut state.capture, &state.camera) > 0 {
        return Ok(true);
    }
    let errors = frame_errors_px(&state.capture, &adjusted.image_residuals, state.noise.pixel_sigma);
    let capture = &mut state.capture;
    let bad = worst_frame(&errors).map(|bad| vec![bad]);
    let bad = bad.unwrap_or_else(|| undetermined_frames(capture, &state.camera, &errors));
    if bad.is_empty() {
        return Ok(false);
    }
    for (place, reason) in bad.into_iter().rev() {
        let frame = capture.frames.remove(place);
        drop_frame(&mut capture.dropped, frame.name.clone(), reason);
    }
    if capture.frames.len() < FEWEST_FRAMES {
        let found = capture.frames.len();
        return Err(StartError::TooFewFrames { found, needed: FEWEST_FRAMES }.into());
    }
    Ok(true)
}

/// A start camera without lens may put a frame into the wrong one of a plane's two poses, where the adjustment then stays.
/// Estimates every pose anew under the adjusted camera and takes those that fit clearly better; returns how many.
fn leave_mirrored_poses(capture: &mut Capture<PosedFrame>, camera: &Camera) -> usize {
    const CLEARLY: f64 = 0.9;
    let better: Vec<Option<Isometry3<f64>>> = capture
        .frames
        .par_iter()
        .map(|frame| {
            let stays = refine_pose(camera, &capture.target, &frame.markers, &frame.camera_from_board)?;
            let other = estimate_pose(camera, &capture.target, &markers_of(frame)).ok()?;
            (other.rms_px < CLEARLY * stays.rms_px).then_some(other.camera_from_board)
        })
        .collect();
    let moved = better.iter().flatten().count();
    for (frame, better) in capture.frames.iter_mut().zip(better) {
        frame.camera_from_board = better.unwrap_or(frame.camera_from_board);
    }
    moved
}

/// Root mean square reprojection error of every frame, px, from whitened residuals.
fn frame_errors_px(capture: &Capture<PosedFrame>, residuals: &[f64], sigma: f64) -> Vec<f64> {
    let mut rest = residuals;
    capture
        .frames
        .iter()
        .map(|frame| {
            let (own, after) = rest.split_at((2 * frame.markers.len()).min(rest.len()));
            rest = after;
            let squares =
                own.iter().zip(frame.markers.iter().flat_map(|m| [m.std_px; 2])).map(|(r, s)| (r * s).powi(2));
            sigma * (squares.sum::<f64>() / frame.markers.len().max(1) as f64).sqrt()
        })
        .collect()
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
fn undetermined_frames(capture: &Capture<PosedFrame>, camera: &Camera, errors: &[f64]) -> Vec<(usize, String)> {
    let Some(median) = upper_median(&mut errors.to_vec()) else { return Vec::new() };
    let sigma = median / std::f64::consts::SQRT_2;
    let doubt = |(i, frame): (usize, &PosedFrame)| {
        let doubt = pose_doubt(camera, &capture.target, &markers_of(frame), &frame.camera_from_board, sigma)?;
        Some((i, doubt.to_string()))
    };
    let mut all: Vec<(usize, String)> = capture.frames.par_iter().enumerate().filter_map(doubt).collect();
    all.sort_by_key(|(i, _)| *i);
    all
}
