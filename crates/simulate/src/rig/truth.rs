//! The truth of a simulated rig, and its observations without images.

use serde::{Deserialize, Serialize};

use super::camera::Streams;
use super::drift::Drift;
use crate::points::PointObservations;
use crate::pose::Pose;
use crate::truth::Truth;

/// The truth of a simulated rig.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RigTruth {
    /// The cameras; the first is the reference.
    pub cameras: Vec<RigCameraTruth>,
}

/// The truth of one camera of a rig.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RigCameraTruth {
    /// Its name.
    pub name: String,
    /// Its images and depth.
    pub streams: Streams,
    /// Its place: maps the rig's frame to its own, mm; without drift.
    pub camera_from_rig: Pose,
    /// How its place changes.
    pub drift: Option<Drift>,
    /// By how much it exposes later than the times of its frames say, s.
    #[serde(default)]
    pub time_offset_s: f64,
    /// Camera, board, effects and poses as this camera sees them.
    pub truth: Truth,
}

/// Observations of a rig without images: those of every camera, in the order of the cameras.
#[derive(Debug, Clone)]
pub struct RigPoints {
    /// The truth.
    pub truth: RigTruth,
    /// The observations of each camera.
    pub cameras: Vec<PointObservations>,
}
