//! The contradiction between the cameras of a rig, in words.

use std::fmt;

use thiserror::Error;

/// A camera of a rig that the other cameras contradict.
#[derive(Debug, Clone, PartialEq, Error)]
#[error(
    "the cameras contradict each other: {camera} has {evidence}{}: check that frames with one name show the same moment (cameras that expose at other moments: \
     --with {camera}:time_offset), that no camera moved, that extrinsics which are declared as known are right, and that the board is one that looks \
     different after half a turn",
    worst(.frames)
)]
pub struct RigContradiction {
    /// The camera.
    pub camera: String,
    /// The quantity that contradicts.
    pub evidence: Evidence,
    /// The frames that stand out, the worst first.
    pub frames: Vec<String>,
}

/// A quantity of which the joint fit says otherwise than the images of one camera alone.
#[derive(Debug, Clone, PartialEq)]
pub enum Evidence {
    /// Noise of its markers, px per coordinate.
    Noise {
        /// In the joint fit.
        joint_px: f64,
        /// By its images alone.
        alone_px: f64,
    },
    /// Its focal length fx with its standard deviation, px.
    FocalLength {
        /// In the joint fit.
        joint_px: [f64; 2],
        /// By its images alone.
        alone_px: [f64; 2],
    },
}

impl fmt::Display for Evidence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Noise { joint_px, alone_px } => {
                write!(
                    f,
                    "markers with a noise of {joint_px:.2} px in the rig, but of {alone_px:.3} px in a fit of this camera alone"
                )
            }
            Self::FocalLength { joint_px: [joint, joint_std], alone_px: [alone, alone_std] } => write!(
                f,
                "a focal length of {joint:.1} ± {joint_std:.1} px in the rig, but of {alone:.1} ± {alone_std:.1} px in a fit of its images alone"
            ),
        }
    }
}

fn worst(frames: &[String]) -> String {
    if frames.is_empty() {
        ", in all frames alike".to_owned()
    } else {
        format!(", most of all in {}", frames.join(", "))
    }
}
