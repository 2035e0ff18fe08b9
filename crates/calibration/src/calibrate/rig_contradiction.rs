//! The contradiction between the cameras of a rig, in words.

use thiserror::Error;

/// A camera of a rig whose markers the other cameras contradict.
#[derive(Debug, Clone, PartialEq, Error)]
#[error(
    "the cameras contradict each other: the markers of {camera} have a noise of {joint_px:.2} px in the rig, but of {alone_px:.3} px in a fit of \
     this camera alone{}: check that frames with one name show the same moment (cameras that expose at other moments: --with {camera}:time_offset), \
     that no camera moved, and that the board is one that looks different after half a turn",
    worst(.frames)
)]
pub struct RigContradiction {
    /// The camera.
    pub camera: String,
    /// Noise of its markers in the joint fit, px per coordinate.
    pub joint_px: f64,
    /// That in the fit of the camera alone.
    pub alone_px: f64,
    /// The frames that stand out, the worst first.
    pub frames: Vec<String>,
}

fn worst(frames: &[String]) -> String {
    if frames.is_empty() {
        ", in all frames alike".to_owned()
    } else {
        format!(", most of all in {}", frames.join(", "))
    }
}
