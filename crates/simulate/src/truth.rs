//! The truth of a simulation. It is never part of a dataset; the caller decides whether and where to keep it.

use serde::{Deserialize, Serialize};

use crate::board::Board;
use crate::camera::CameraTruth;
use crate::conditions::Conditions;
use crate::defects::{DefectiveFrames, Defects};
use crate::effects::EffectTruth;
use crate::kind::Kind;
use crate::noise::Noise;
use crate::pose::Pose;

/// The truth of a simulation: camera, board, effects, poses, conditions and defects.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Truth {
    /// The camera.
    pub camera: CameraTruth,
    /// The board as designed; errors of the real board are among `effects`.
    pub board: Board,
    /// The spacing that the dataset declares, mm.
    pub declared_spacing_mm: f64,
    /// Distribution of the board's poses.
    pub kind: Kind,
    /// Seed of the capture.
    pub seed: u64,
    /// Number of the individual camera; see [`Simulation::unit`](crate::Simulation::unit).
    pub unit: u64,
    /// The effects with their parameters.
    pub effects: Vec<EffectTruth>,
    /// Noise and blur.
    pub noise: Noise,
    /// Poses and conditions of the frames.
    pub frames: Vec<FrameTruth>,
    /// Requested defects.
    pub defects: Defects,
    /// The frames that have them.
    pub defective: DefectiveFrames,
}

/// One frame of a [`Truth`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrameTruth {
    /// Stem of its files.
    pub name: String,
    /// Pose of the board in the image.
    pub pose: Pose,
    /// Pose of the board in the depth image; differs from `pose` only in frames with defects.
    pub depth_pose: Pose,
    /// Time and temperature.
    pub conditions: Conditions,
}
