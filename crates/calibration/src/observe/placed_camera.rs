//! Cameras with their places, as a calibration gives them to those who use it.

use depthcal_model::Camera;
use nalgebra::{Isometry3, Point3};

use crate::observe::{PlaceDrift, Taken};

/// A camera on a rig.
#[derive(Debug, Clone)]
pub struct PlacedCamera {
    /// Its name.
    pub name: String,
    /// The camera.
    pub camera: Camera,
    /// Its place: maps the rig's frame to its own, mm.
    pub camera_from_rig: Isometry3<f64>,
    /// How its place changes; `None` where it does not.
    pub drift: Option<PlaceDrift>,
}

impl PlacedCamera {
    /// The camera as it is placed when something is taken so.
    #[must_use]
    pub fn at(&self, taken: &Taken) -> Self {
        let place = self.drift.map_or(self.camera_from_rig, |drift| drift.place(&self.camera_from_rig, taken));
        Self { camera_from_rig: place, drift: None, ..self.clone() }
    }

    /// A point of this camera's frame in the rig's, mm.
    pub fn in_rig(&self, point_mm: [f64; 3]) -> [f64; 3] {
        let point = self.camera_from_rig.inverse() * Point3::from(point_mm);
        [point.x, point.y, point.z]
    }

    /// The pose that maps the frame of `other` to that of this camera.
    pub fn from(&self, other: &Self) -> Isometry3<f64> {
        self.camera_from_rig * other.camera_from_rig.inverse()
    }
}
