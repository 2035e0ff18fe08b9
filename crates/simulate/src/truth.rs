//! What was simulated. The caller decides where, if anywhere, this is kept; it is never part of a dataset.

use serde::{Deserialize, Serialize};

use crate::board::Board;
use crate::camera::CameraTruth;
use crate::conditions::Conditions;
use crate::defects::{DefectiveFrames, Defects};
use crate::effects::EffectTruth;
use crate::kind::Kind;
use crate::noise::Noise;
use crate::pose::Pose;

/// Everything that a simulation was made from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Truth {
    /// The camera.
    pub camera: CameraTruth,
    /// The board as printed; effects on it are among `effects`.
    pub board: Board,
    /// The spacing that the dataset declares, mm.
    pub declared_spacing_mm: f64,
    /// How the board was held.
    pub kind: Kind,
    /// Seed of the capture.
    pub seed: u64,
    /// The individual camera, see [`crate::Simulation::unit`].
    pub unit: u64,
    /// The effects with their parameters.
    pub effects: Vec<EffectTruth>,
    /// Noise and blur.
    pub noise: Noise,
    /// Poses and conditions of the frames.
    pub frames: Vec<FrameTruth>,
    /// Defects that were asked for.
    pub defects: Defects,
    /// The frames that they hit.
    pub defective: DefectiveFrames,
}

/// One frame of a [`Truth`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrameTruth {
    /// Stem of its files.
    pub name: String,
    /// Pose of the board in the image.
    pub pose: Pose,
    /// Pose of the board in the depth image; the same but for defects.
    pub depth_pose: Pose,
    /// Time and temperature.
    pub conditions: Conditions,
}
