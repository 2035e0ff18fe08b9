//! A camera without distortion and one pose per frame, from the markers alone.

use depthcal_model::{Block, Camera, Register, Target};
use nalgebra::Isometry3;
use tracing::warn;

use super::error::{FEWEST_FRAMES, StartError};
use super::frame_markers::FrameMarkers;
use super::homography::fit_homography;
use super::lens_models::{KANNALA_BRANDT, lens_block};
use super::pose::estimate_pose;
use super::wide_angle::{equidistant, error_px, imitating, widest};
use super::zhang::{check_tilts, pinhole_from_homographies};

/// Reprojection error without lens, in image widths, from which a camera may be a wide one: 0.16 px at 640 px. Poses take up most
/// of what a fisheye lens does to small boards.
const BENT: f64 = 0.00025;
/// Share of that error up to which an equidistant camera leaves of a wide lens. Of the barrel distortion of usual cameras it
/// leaves about as much.
const CLEARLY: f64 = 0.5;
/// Angle between the optical axis and the image's corners, rad, from which a lens may be wide: an equidistant camera of a long
/// focal length is only another description of weak barrel distortion.
const WIDE_RADIANS: f64 = 0.85;

/// A camera with the named lens model (`none` for no lens model), and one pose per frame, from the markers alone: start values
/// for an adjustment. `width` and `height` are the images' size, px.
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

/// The camera of [`start_values`] alone. Each frame counts as much as its markers determine its homography. Where straight lines
/// are strongly bent, or the lens is a fisheye, it has a lens at start values of its own (`wide_angle`).
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
    let pinhole = pinhole_from_homographies(&homographies, width, height);
    let Some(block) = lens_block(lens, register)? else {
        return Ok(Camera::from_blocks(width, height, Block::pinhole(pinhole?), Vec::new()));
    };
    let widest = widest(frames, width, height);
    let narrow = pinhole.map(|pinhole| Camera::new(width, height, pinhole, Vec::new()));
    let bent_px = narrow.as_ref().map_or(f64::INFINITY, |camera| error_px(camera, target, &widest));
    let is_fisheye = block.name() == KANNALA_BRANDT;
    if let Ok(camera) = &narrow
        && !is_fisheye
        && bent_px < BENT * width as f64
    {
        return Ok(camera.with_block(block));
    }
    let (wide, error) = equidistant(target, narrow.as_ref().ok(), [width, height], &widest, register)?;
    let is_wide = is_clearly_wide(&wide, error, bent_px);
    match narrow {
        Err(reason) if !is_wide => Err(reason),
        Ok(camera) if !is_wide && !is_fisheye => Ok(camera.with_block(block)),
        Ok(camera) if bent_px <= error => Ok(imitating(block, &camera, frames)),
        _ => {
            if block.name() == "brown_conrady" {
                warn!(
                    "straight lines are strongly bent: an equidistant camera leaves {error:.1} px where one without lens leaves \
                     {bent_px:.1} px; compare with the lens kannala-brandt, or auto"
                );
            }
            Ok(imitating(block, &wide, frames))
        }
    }
}

/// Whether an equidistant camera explains the markers clearly better than one without lens, or homographies give no pinhole.
#[cfg(feature = "detect")]
pub(crate) fn is_wide(
    target: &Target,
    width: usize,
    height: usize,
    frames: &[FrameMarkers<'_>],
    register: &Register,
) -> bool {
    let homographies: Vec<_> = frames.iter().filter_map(|f| fit_homography(target, f).ok()).collect();
    let Ok(pinhole) = pinhole_from_homographies(&homographies, width, height) else { return true };
    let camera = Camera::new(width, height, pinhole, Vec::new());
    let widest = widest(frames, width, height);
    let bent_px = error_px(&camera, target, &widest);
    let wide = || equidistant(target, Some(&camera), [width, height], &widest, register);
    bent_px >= BENT * width as f64 && wide().is_ok_and(|(wide, error)| is_clearly_wide(&wide, error, bent_px))
}

/// Whether an equidistant camera, with its reprojection error, is wide and clearly better than a camera without lens.
fn is_clearly_wide(equidistant: &Camera, error_px: f64, bent_px: f64) -> bool {
    let [fx, fy, ..] = equidistant.pinhole();
    let corner = (0.5 * equidistant.width as f64 / fx).hypot(0.5 * equidistant.height as f64 / fy);
    error_px < CLEARLY * bent_px && corner > WIDE_RADIANS
}
