//! One camera of a rig.

use serde::{Deserialize, Serialize};

use super::drift::Drift;
use crate::camera::CameraTruth;
use crate::effects::Effect;
use crate::light::Exposure;
use crate::noise::Noise;
use crate::pose::Pose;

/// Images and depth of a rig's camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Streams {
    /// Infrared images and depth on the same pixels.
    InfraredAndDepth,
    /// Depth whose image cannot be had.
    Depth,
    /// Colour images.
    Colour,
}

impl Streams {
    /// Whether there are images.
    pub fn has_image(self) -> bool {
        self != Self::Depth
    }

    /// Whether there is depth.
    pub fn has_depth(self) -> bool {
        self != Self::Colour
    }
}

/// A camera of a rig: what it is, where it sits, what is wrong with it.
#[derive(Debug, Clone)]
pub struct RigCamera {
    /// Its name, a folder of the dataset.
    pub name: String,
    /// Its images and depth.
    pub streams: Streams,
    /// The camera.
    pub camera: CameraTruth,
    /// Its place: maps the rig's frame, which is that of the first camera, to its own, mm.
    pub camera_from_rig: Pose,
    /// Its errors.
    pub effects: Vec<Effect>,
    /// Its noise.
    pub noise: Noise,
    /// Its light and exposure.
    pub exposure: Exposure,
    /// How its place changes with time or temperature.
    pub drift: Option<Drift>,
    /// By how much it exposes later than the times of its frames say, s; it matters where the board moves.
    pub time_offset_s: f64,
}

impl RigCamera {
    /// A camera without effects. Colour cameras are lit by the room, the others by their own emitter.
    pub fn new(name: impl Into<String>, streams: Streams, camera: CameraTruth, camera_from_rig: Pose) -> Self {
        let exposure = match streams {
            Streams::Colour => Exposure::Room { white: 0.75 },
            Streams::InfraredAndDepth | Streams::Depth => Exposure::Auto { white: 0.6 },
        };
        Self {
            name: name.into(),
            streams,
            camera,
            camera_from_rig,
            effects: Vec::new(),
            noise: Noise::default(),
            exposure,
            drift: None,
            time_offset_s: 0.0,
        }
    }

    /// Adds an effect.
    #[must_use]
    pub fn effect(mut self, effect: Effect) -> Self {
        self.effects.push(effect);
        self
    }

    /// Makes the camera expose later, s.
    #[must_use]
    pub fn time_offset(mut self, time_offset_s: f64) -> Self {
        self.time_offset_s = time_offset_s;
        self
    }

    /// Makes the camera's extrinsics drift.
    #[must_use]
    pub fn drift(mut self, drift: Drift) -> Self {
        self.drift = Some(drift);
        self
    }
}
