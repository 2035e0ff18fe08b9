//! Places of cameras that change with time or temperature.

use nalgebra::{Rotation3, Vector3};
use serde::{Deserialize, Serialize};

use crate::conditions::{Conditions, REFERENCE_TEMPERATURE_C};
use crate::pose::Pose;

/// A camera's motion on its rig.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "with", rename_all = "kebab-case")]
pub enum Drift {
    /// In proportion to time.
    Time {
        /// Rotation vector in the camera's frame over the whole session, rad.
        rotation_rad: [f64; 3],
        /// Displacement in the camera's frame over the whole session, mm.
        translation_mm: [f64; 3],
    },
    /// In proportion to the temperature above 30 °C.
    Temperature {
        /// Rotation vector in the camera's frame, rad/°C.
        rotation_rad: [f64; 3],
        /// Displacement in the camera's frame, mm/°C.
        translation_mm: [f64; 3],
    },
}

impl Drift {
    /// The place of a camera, whose own is `camera_from_rig`, under these conditions.
    pub(super) fn apply(&self, camera_from_rig: &Pose, conditions: &Conditions) -> Pose {
        let (share, rotation_rad, translation_mm) = match *self {
            Self::Time { rotation_rad, translation_mm } => {
                (conditions.time_s / conditions.session_s, rotation_rad, translation_mm)
            }
            Self::Temperature { rotation_rad, translation_mm } => {
                (conditions.temperature_c - REFERENCE_TEMPERATURE_C, rotation_rad, translation_mm)
            }
        };
        let turn = Rotation3::new(Vector3::from(rotation_rad) * share);
        Pose::new(turn, Vector3::from(translation_mm) * share).after(camera_from_rig)
    }
}
