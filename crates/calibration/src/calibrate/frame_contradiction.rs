//! The contradiction between the frames of one camera, in words.

use thiserror::Error;

use super::undetermined::listed;

/// Frames of one camera that contradict each other.
#[derive(Debug, Clone, PartialEq, Error)]
#[error(
    "the frames are of two cameras, or of one at two zooms: the focal length of {} is {:.0} px, that of {} {:.0} px, and markers have a noise of \
     {joint_px:.3} px with one camera for all frames, of {:.3} px with two: make a dataset of each, and switch zoom, autofocus and digital stabilisation off",
    listed(&.groups[0].frames), .groups[0].focal_px, listed(&.groups[1].frames), .groups[1].focal_px, .groups[0].noise_px.max(.groups[1].noise_px)
)]
pub struct FrameContradiction {
    /// Noise of the markers in the fit of all frames, px per coordinate.
    pub joint_px: f64,
    /// Two groups that agree within.
    pub groups: [AgreeingFrames; 2],
}

/// Frames that agree with each other.
#[derive(Debug, Clone, PartialEq)]
pub struct AgreeingFrames {
    /// Their focal length fx, px.
    pub focal_px: f64,
    /// Noise of their markers, px per coordinate.
    pub noise_px: f64,
    /// Their names.
    pub frames: Vec<String>,
}
