//! Camera, lens and poses from the markers alone.

use depthcal_model::Camera;
use depthcal_statistics::upper_median;
use nalgebra::Isometry3;
use rayon::prelude::*;
use tracing::warn;

use super::error::CalibrateError;
use super::fitted::Calibrated;
use super::options::CalibrateOptions;
use super::settle::{Freedom, ROUNDS, Rules, State, settle};
use crate::adjust::adjustment::Adjusted;
use crate::adjust::blocks::is_depth_only;
use crate::adjust::smoothness_prior::Smoothness;
use crate::observe::noise::{DepthNoise, NoiseModel};
use crate::observe::{Capture, DroppedFrame, PosedFrame};
use crate::start::{FEWEST_FRAMES, FEWEST_MARKERS, FrameMarkers, StartError, estimate_pose, refine_pose, start_values};

/// Frames whose reprojection error exceeds this many times the median are misdetected boards.
const BAD_FRAME_RATIO: f64 = 6.0;
/// … but never those below this error, px.
const BAD_FRAME_FLOOR_PX: f64 = 0.5;

/// Adjusts camera, lens and poses to the markers alone, from start values that are found here; drops misdetected frames.
///
/// # Errors
///
/// [`CalibrateError`], where the captures do not determine the camera.
pub fn calibrate_image(
    capture: &Capture,
    options: &CalibrateOptions,
) -> Result<Calibrated<PosedFrame>, CalibrateError> {
    let _stage = options.progress.stage("image calibration");
    let mut capture = capture.clone();
    capture.frames.retain(|frame| {
        let enough = frame.markers.len() >= FEWEST_MARKERS;
        if !enough {
            let reason = format!("only {} markers", frame.markers.len());
            capture.dropped.push(DroppedFrame { name: frame.name.clone(), reason });
        }
        enough
    });
    let lens = options.lens.replace('-', "_");
    let markers: Vec<FrameMarkers<'_>> =
        capture.frames.iter().map(|f| FrameMarkers { name: &f.name, markers: &f.markers }).collect();
    let (mut camera, poses) = match &options.camera {
        Some(camera) => {
            let poses = markers.iter().map(|m| estimate_pose(camera, &capture.target, m).map(|p| p.camera_from_board));
            (camera.clone(), poses.collect::<Result<Vec<_>, _>>()?)
        }
        None => start_values(&capture.target, capture.width, capture.height, &markers, &lens, &options.register)?,
    };
    for effect in &options.effects {
        let block = options.register.make(effect, None)?;
        if !is_depth_only(&block) {
            camera = camera.with_block(block);
        }
    }
    let frames = capture.frames.iter().cloned().zip(poses);
    let posed = frames.map(|(detected, camera_from_board)| PosedFrame { detected, camera_from_board }).collect();
    let noise = NoiseModel { pixel_sigma: 0.3, depth: DepthNoise { a_per_mm: 1e-5, b_mm: 0.0 } };
    let start = State { capture: capture.with_frames(posed), camera, noise, smoothness: Smoothness::default() };
    let rules = Rules {
        with_depth: false,
        freedom: Freedom::FromCovariance,
        last_to_drop: 0,
        most_rounds: 2 * ROUNDS + 1,
        depth_noise_settled: 0.0,
        chooses_smoothness: false,
        repair: &repair,
    };
    settle(start, &rules, options)
}

/// Leaves mirrored poses, and drops the frame that fits far worse than the others.
fn repair(round: usize, state: &mut State<PosedFrame>, adjusted: &Adjusted) -> Result<bool, CalibrateError> {
    // Before a frame is called bad: its pose may only be the wrong one of two.
    if round <= ROUNDS && leave_mirrored_poses(&mut state.capture, &state.camera) > 0 {
        return Ok(true);
    }
    let capture = &mut state.capture;
    let Some((worst, reason)) = worst_frame(capture, &adjusted.image_residuals, state.noise.pixel_sigma) else {
        return Ok(false);
    };
    let frame = capture.frames.remove(worst);
    warn!("frame {} is dropped: {reason}", frame.name);
    capture.dropped.push(DroppedFrame { name: frame.name.clone(), reason });
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
            let markers = FrameMarkers { name: &frame.name, markers: &frame.markers };
            let stays = refine_pose(camera, &capture.target, &frame.markers, &frame.camera_from_board)?;
            let other = estimate_pose(camera, &capture.target, &markers).ok()?;
            (other.rms_px < CLEARLY * stays.rms_px).then_some(other.camera_from_board)
        })
        .collect();
    let moved = better.iter().flatten().count();
    for (frame, better) in capture.frames.iter_mut().zip(better) {
        frame.camera_from_board = better.unwrap_or(frame.camera_from_board);
    }
    moved
}

/// The frame that fits far worse than the others, and why it goes.
fn worst_frame(capture: &Capture<PosedFrame>, residuals: &[f64], sigma: f64) -> Option<(usize, String)> {
    let mut rest = residuals;
    let errors: Vec<f64> = capture
        .frames
        .iter()
        .map(|frame| {
            let (own, after) = rest.split_at((2 * frame.markers.len()).min(rest.len()));
            rest = after;
            let squares =
                own.iter().zip(frame.markers.iter().flat_map(|m| [m.std_px; 2])).map(|(r, s)| (r * s).powi(2));
            sigma * (squares.sum::<f64>() / frame.markers.len().max(1) as f64).sqrt()
        })
        .collect();
    let median = upper_median(&mut errors.clone())?;
    let (worst, error) = errors.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1))?;
    let reason = format!(
        "its reprojection error is {error:.2} px where the median frame has {median:.2} px: a misdetected board"
    );
    (*error > BAD_FRAME_FLOOR_PX && *error > BAD_FRAME_RATIO * median).then_some((worst, reason))
}
