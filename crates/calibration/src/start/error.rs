//! Errors of the start values, and the limits below which captures are refused.

use depthcal_model::RegisterError;
use thiserror::Error;

/// Fewest markers for the homography of a frame: with four, which determine it exactly, nothing could check it.
pub const FEWEST_MARKERS: usize = 6;
/// Fewest frames for a calibration.
pub const FEWEST_FRAMES: usize = 3;
/// Largest angle between two boards at which they count as parallel, degrees.
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
    /// No pose puts the board in front of the camera.
    #[error("no pose explains the markers of frame '{frame}'")]
    NoPose {
        /// The frame.
        frame: String,
    },
    /// The lens model's name is unknown.
    #[error(transparent)]
    Register(#[from] RegisterError),
}
