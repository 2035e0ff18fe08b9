//! A camera without distortion and one pose per frame, from the markers alone.

use depthcal_model::{Block, Camera, Register, Target};
use nalgebra::Isometry3;

use super::error::{FEWEST_FRAMES, StartError};
use super::frame_markers::FrameMarkers;
use super::homography::fit_homography;
use super::pose::estimate_pose;
use super::zhang::{check_tilts, pinhole_from_homographies};

/// A camera with the named lens model at its nominal parameters, that is without distortion (`none` for no lens model), and one
/// pose per frame, from the markers alone. They are start values for an adjustment. `width` and `height` are the images' size,
/// px.
///
/// # Errors
///
/// [`StartError`], where the frames do not determine a camera, or where the lens model is unknown.
pub fn start_values(
    target: &Target,
    width: usize,
    height: usize,
    frames: &[FrameMarkers<'_>],
    lens: &str,
    register: &Register,
) -> Result<(Camera, Vec<Isometry3<f64>>), StartError> {
    let camera = start_camera(target, width, height, frames, lens, register)?;
    let poses = frames.iter().map(|f| estimate_pose(&camera, target, f).map(|fit| fit.camera_from_board));
    let poses = poses.collect::<Result<Vec<_>, _>>()?;
    Ok((camera, poses))
}

/// The camera of [`start_values`] alone. Each frame counts as much as its markers determine its homography.
///
/// # Errors
///
/// [`StartError`], where the frames do not determine a camera, or where the lens model is unknown.
pub fn start_camera(
    target: &Target,
    width: usize,
    height: usize,
    frames: &[FrameMarkers<'_>],
    lens: &str,
    register: &Register,
) -> Result<Camera, StartError> {
    if frames.len() < FEWEST_FRAMES {
        return Err(StartError::TooFewFrames { found: frames.len(), needed: FEWEST_FRAMES });
    }
    let homographies = frames.iter().map(|f| fit_homography(target, f)).collect::<Result<Vec<_>, _>>()?;
    check_tilts(&homographies, width, height)?;
    let pinhole = pinhole_from_homographies(&homographies, width, height)?;
    let lens = if lens == "none" { Vec::new() } else { vec![register.block(lens, None)?] };
    Ok(Camera::from_blocks(width, height, Block::pinhole(pinhole), lens))
}
