//! How far a board is from the pose that is wanted, and in which direction.

use depthcal_model::{Camera, Target};
use nalgebra::{Isometry3, Point3, Vector3};

/// Ratio of distances up to which a board is there.
const RATIO: f64 = 1.12;
/// Distance in the image, as a share of its diagonal.
const PLACE: f64 = 0.07;
/// Angle between the boards' normals, degrees.
const ANGLE_DEG: f64 = 13.0;

/// The view of a board: distance, place in the image, tilt.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct View {
    /// Depth of the board's middle, mm.
    pub distance_mm: f64,
    /// Its pixel.
    pub pixel: [f64; 2],
    /// Turn about the horizontal and the vertical axis, degrees: positive ones bring the upper and the right side nearer.
    pub turn_deg: [f64; 2],
    normal: Vector3<f64>,
}

impl View {
    /// The view of a board in a pose; `None` where its middle is not seen.
    pub(crate) fn of(camera: &Camera, target: &Target, pose: &Isometry3<f64>) -> Option<Self> {
        let [low, high] = target.marker_rectangle();
        let middle = pose * Point3::new((low[0] + high[0]) / 2.0, (low[1] + high[1]) / 2.0, 0.0);
        let normal = pose.rotation * Vector3::z();
        let turn_deg = [f64::atan2(-normal.y, normal.z), f64::atan2(normal.x, normal.z)].map(f64::to_degrees);
        Some(Self { distance_mm: middle.z, pixel: camera.project(&middle.coords)?, turn_deg, normal })
    }

    /// Angle between the normal and the optical axis, degrees.
    pub(crate) fn tilt_deg(&self) -> f64 {
        self.normal.z.clamp(-1.0, 1.0).acos().to_degrees()
    }

    /// How far it is from another: the parts of distance, place and tilt, each 1 where it just counts as there.
    fn parts_to(&self, wanted: &Self, camera: &Camera) -> [f64; 3] {
        let diagonal = (camera.width as f64).hypot(camera.height as f64);
        let ratio = (self.distance_mm / wanted.distance_mm).ln().abs() / RATIO.ln();
        let place = (self.pixel[0] - wanted.pixel[0]).hypot(self.pixel[1] - wanted.pixel[1]) / (PLACE * diagonal);
        let angle = self.normal.angle(&wanted.normal).to_degrees() / ANGLE_DEG;
        [ratio, place, angle]
    }

    /// The part of distance, place and tilt that is farthest from a wanted view: at most 1 where the board is there.
    pub(crate) fn distance_to(&self, wanted: &Self, camera: &Camera) -> f64 {
        self.parts_to(wanted, camera).into_iter().fold(0.0, f64::max)
    }

    /// The movement that brings it nearest to a wanted view, in words, for who looks at the picture.
    pub(crate) fn hint_to(&self, wanted: &Self, camera: &Camera) -> &'static str {
        let [ratio, place, angle] = self.parts_to(wanted, camera);
        if place >= ratio.max(angle) {
            let [right, down] = [0, 1].map(|i| wanted.pixel[i] - self.pixel[i]);
            return match (right.abs() > down.abs(), right > 0.0, down > 0.0) {
                (true, true, _) => "to the right in the picture",
                (true, false, _) => "to the left in the picture",
                (false, _, true) => "down in the picture",
                (false, _, false) => "up in the picture",
            };
        }
        if ratio >= angle {
            let farther = self.distance_mm < wanted.distance_mm;
            return if farther { "away from the camera" } else { "nearer to the camera" };
        }
        let [upper, right] = [0, 1].map(|i| wanted.turn_deg[i] - self.turn_deg[i]);
        match (right.abs() > upper.abs(), right > 0.0, upper > 0.0) {
            (true, true, _) => "tilt: its right side nearer",
            (true, false, _) => "tilt: its left side nearer",
            (false, _, true) => "tilt: its upper side nearer",
            (false, _, false) => "tilt: its lower side nearer",
        }
    }
}
