//! A camera without distortion and a pose per frame, from the markers alone.

use depthcal_model::{Block, Camera, Register, Target};
use nalgebra::Isometry3;

use super::error::{FEWEST_FRAMES, StartError};
use super::frame_markers::FrameMarkers;
use super::homography::homography;
use super::pose::estimate_pose;
use super::zhang::{check_tilts, pinhole_from_homographies};

/// A camera with a distortion-free lens model of the given name (`none` for no lens) and a pose (camera from board) per
/// frame, from the markers alone. Refinement by adjustment is the caller's.
///
/// # Errors
///
/// [`StartError`], where the captures do not determine a camera.
pub fn start_values(
    target: &Target,
    width: usize,
    height: usize,
    frames: &[FrameMarkers<'_>],
    lens: &str,
    register: &Register,
) -> Result<(Camera, Vec<Isometry3<f64>>), StartError> {
    if frames.len() < FEWEST_FRAMES {
        return Err(StartError::TooFewFrames { found: frames.len(), needed: FEWEST_FRAMES });
    }
    let homographies = frames.iter().map(|f| homography(target, f)).collect::<Result<Vec<_>, _>>()?;
    check_tilts(&homographies, width, height)?;
    let pinhole = pinhole_from_homographies(&homographies, width, height)?;
    let lens = if lens == "none" { Vec::new() } else { vec![register.block(lens, None)?] };
    let camera = Camera::from_blocks(width, height, Block::pinhole(pinhole), lens);
    let poses = frames.iter().map(|f| estimate_pose(&camera, target, f).map(|fit| fit.camera_from_board));
    let poses = poses.collect::<Result<Vec<_>, _>>()?;
    Ok((camera, poses))
}
