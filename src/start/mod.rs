//! Start values without a guess from the user: homographies, Zhang's closed form, poses.
//!
//! Sets of captures that cannot determine a camera end in a [`StartError`] that says what is missing.

mod homography;
mod pose;
mod zhang;

use depthcal_model::{Block, Camera, Register, RegisterError, Target};
use nalgebra::Isometry3;
use thiserror::Error;

pub use homography::homography;
pub use pose::{PoseFit, estimate_pose, refine_pose};
pub use zhang::{check_tilts, pinhole_from_homographies};

use crate::observations::MarkerObservation;

/// Fewest markers from which a frame's homography is taken: four would leave nothing to check it by.
pub const FEWEST_MARKERS: usize = 6;
/// Fewest frames from which a camera is calibrated.
pub const FEWEST_FRAMES: usize = 3;
/// Boards that all lie within this angle of each other count as parallel, degrees.
pub const PARALLEL_DEG: f64 = 4.0;

/// Why there are no start values.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum StartError {
    /// Too few usable frames.
    #[error(
        "{found} usable frame(s), but a camera needs at least {needed}: capture the board from more directions, tilted \
         by 20° to 45°"
    )]
    TooFewFrames {
        /// Frames with enough markers.
        found: usize,
        /// Frames needed.
        needed: usize,
    },
    /// A frame shows too few markers.
    #[error("frame '{frame}' shows {found} markers, but at least {needed} are needed")]
    TooFewMarkers {
        /// The frame.
        frame: String,
        /// Markers found.
        found: usize,
        /// Markers needed.
        needed: usize,
    },
    /// The markers of a frame lie on a line.
    #[error(
        "the markers of frame '{frame}' lie on a line, which does not determine the board's plane: use a board with at \
         least two rows, and see that both are found"
    )]
    Collinear {
        /// The frame.
        frame: String,
    },
    /// All boards are parallel, which leaves the focal length undetermined.
    #[error(
        "all {frames} boards are parallel within {spread_deg:.1}°, which leaves the focal length undetermined: add \
         captures with the board tilted by 20° to 45° about both axes"
    )]
    ParallelBoards {
        /// Frames looked at.
        frames: usize,
        /// Largest angle between two boards, degrees.
        spread_deg: f64,
    },
    /// The closed form has no real focal length.
    #[error(
        "the homographies of the {frames} frames give no real focal length: look for misdetected boards, or add captures \
         with the board tilted by 20° to 45° about both axes"
    )]
    NoFocalLength {
        /// Frames used.
        frames: usize,
    },
    /// No pose puts the board before the camera.
    #[error("no pose explains the markers of frame '{frame}'")]
    NoPose {
        /// The frame.
        frame: String,
    },
    /// The lens model's name is unknown.
    #[error(transparent)]
    Register(#[from] RegisterError),
}

/// The markers of one frame, as the start values need them.
#[derive(Debug, Clone, Copy)]
pub struct FrameMarkers<'a> {
    /// Name for messages.
    pub name: &'a str,
    /// What was found.
    pub markers: &'a [MarkerObservation],
}

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
