//! Camera, lens and poses from the markers alone.

use depthcal_model::Camera;
use nalgebra::Isometry3;
use rayon::prelude::*;
use tracing::warn;

use super::{
    CalibrateError, CalibrateOptions, Calibrated, LEAST_PIXEL_SIGMA, NOISE_SETTLED, ROUNDS, converged, finish,
};
use crate::adjustment::Adjustment;
use crate::noise::{DepthNoise, NoiseModel, clipped_sigma};
use crate::observations::{Capture, DroppedFrame};
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
pub fn calibrate_image(capture: &Capture, options: &CalibrateOptions) -> Result<Calibrated, CalibrateError> {
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
    let (mut camera, mut poses) = match &options.camera {
        Some(camera) => {
            let poses = markers.iter().map(|m| estimate_pose(camera, &capture.target, m).map(|p| p.camera_from_board));
            (camera.clone(), poses.collect::<Result<Vec<_>, _>>()?)
        }
        None => start_values(&capture.target, capture.width, capture.height, &markers, &lens, &options.register)?,
    };
    for name in &options.effects {
        let block = options.register.block(name, None)?;
        if !crate::adjustment::is_depth_only(&block) {
            camera = camera.with_block(block);
        }
    }
    let mut noise = NoiseModel { pixel_sigma: 0.3, depth: DepthNoise { a_per_mm: 1e-5, b_mm: 0.0 } };
    let mut round = 0;
    loop {
        round += 1;
        let mut adjustment = Adjustment::new(&capture, &camera, &poses, &noise, false);
        let adjusted = adjustment.solve()?;
        (camera, poses) = (adjusted.camera.clone(), adjusted.poses.clone());
        // Before a frame is called bad: its pose may only be the wrong one of two.
        if round <= ROUNDS && leave_mirrored_poses(&capture, &camera, &mut poses) > 0 {
            continue;
        }
        if let Some(bad) = worst_frame(&capture, &adjusted.image_residuals, noise.pixel_sigma) {
            let frame = capture.frames.remove(bad.0);
            poses.remove(bad.0);
            warn!("frame {} is dropped: {}", frame.name, bad.1);
            capture.dropped.push(DroppedFrame { name: frame.name, reason: bad.1 });
            if capture.frames.len() < FEWEST_FRAMES {
                let found = capture.frames.len();
                return Err(StartError::TooFewFrames { found, needed: FEWEST_FRAMES }.into());
            }
            continue;
        }
        let before = noise.pixel_sigma;
        let covariance = adjustment.covariance()?;
        let redundancy = adjustment.redundancies(&covariance).0;
        let n = adjusted.image_residuals.len() as f64;
        noise.pixel_sigma *= clipped_sigma(&adjusted.image_residuals) * (n / redundancy.max(1.0)).sqrt();
        noise.pixel_sigma = noise.pixel_sigma.max(LEAST_PIXEL_SIGMA);
        let settled = (noise.pixel_sigma / before - 1.0).abs() < NOISE_SETTLED;
        if settled || round > 2 * ROUNDS {
            converged(&adjusted)?;
            let covariance = adjustment.camera_covariance(&covariance);
            return Ok(finish(capture, adjusted, noise, before, Some(covariance), None, options));
        }
    }
}

/// A start camera without lens may put a frame into the wrong one of a plane's two poses, where the adjustment then stays.
/// Estimates every pose anew under the adjusted camera and takes those that fit clearly better; returns how many.
fn leave_mirrored_poses(capture: &Capture, camera: &Camera, poses: &mut [Isometry3<f64>]) -> usize {
    const CLEARLY: f64 = 0.9;
    let better: Vec<Option<Isometry3<f64>>> = capture
        .frames
        .par_iter()
        .zip(&*poses)
        .map(|(frame, pose)| {
            let markers = FrameMarkers { name: &frame.name, markers: &frame.markers };
            let stays = refine_pose(camera, &capture.target, &frame.markers, pose)?;
            let other = estimate_pose(camera, &capture.target, &markers).ok()?;
            (other.rms_px < CLEARLY * stays.rms_px).then_some(other.camera_from_board)
        })
        .collect();
    let moved = better.iter().flatten().count();
    for (pose, better) in poses.iter_mut().zip(better) {
        *pose = better.unwrap_or(*pose);
    }
    moved
}

/// The frame that fits far worse than the others, and why it goes.
fn worst_frame(capture: &Capture, residuals: &[f64], sigma: f64) -> Option<(usize, String)> {
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
    let mut sorted = errors.clone();
    sorted.sort_by(f64::total_cmp);
    let median = *sorted.get(sorted.len() / 2)?;
    let (worst, error) = errors.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1))?;
    let reason = format!(
        "its reprojection error is {error:.2} px where the median frame has {median:.2} px: a misdetected board"
    );
    (*error > BAD_FRAME_FLOOR_PX && *error > BAD_FRAME_RATIO * median).then_some((worst, reason))
}
