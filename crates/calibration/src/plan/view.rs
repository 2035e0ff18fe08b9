//! The view of a board in numbers, and how far two views are apart.

use depthcal_model::{Camera, Target};
use nalgebra::{Isometry3, Point3, Vector3};

/// Ratio of distances that counts as one step apart.
const RATIO: f64 = 1.12;
/// Distance in the image that does, as a share of its diagonal.
const PLACE: f64 = 0.07;
/// Angle between the boards' normals that does, degrees.
const ANGLE_DEG: f64 = 13.0;

/// The view of a board: distance, place in the image, tilt.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoardView {
    /// Depth of the board's middle, mm.
    pub distance_mm: f64,
    /// Pixel of the board's middle.
    pub pixel: [f64; 2],
    /// Turn about the horizontal and the vertical axis, degrees: positive ones bring the upper and the right side nearer.
    pub turn_deg: [f64; 2],
    /// The board's normal in the camera's frame, away from the camera.
    normal: Vector3<f64>,
}

impl BoardView {
    /// The view of a board in a pose (camera from board); `None` where its middle is not seen.
    pub fn new(camera: &Camera, target: &Target, pose: &Isometry3<f64>) -> Option<Self> {
        let [low, high] = target.marker_rectangle();
        let middle = pose * Point3::new((low[0] + high[0]) / 2.0, (low[1] + high[1]) / 2.0, 0.0);
        let normal = pose.rotation * Vector3::z();
        let turn_deg = [f64::atan2(-normal.y, normal.z), f64::atan2(normal.x, normal.z)].map(f64::to_degrees);
        Some(Self { distance_mm: middle.z, pixel: camera.project(&middle.coords)?, turn_deg, normal })
    }

    /// Angle between the normal and the optical axis, degrees.
    pub fn tilt_deg(&self) -> f64 {
        self.normal.z.clamp(-1.0, 1.0).acos().to_degrees()
    }

    /// Steps by which distance, place in the image and tilt are apart: 12 % of the distance, 7 % of the image's diagonal, and 13°
    /// are one each. Up to one step in all three a person who holds a board is at the other view.
    pub fn steps_to(&self, other: &Self, camera: &Camera) -> [f64; 3] {
        let diagonal = (camera.width as f64).hypot(camera.height as f64);
        let ratio = (self.distance_mm / other.distance_mm).ln().abs() / RATIO.ln();
        let place = (self.pixel[0] - other.pixel[0]).hypot(self.pixel[1] - other.pixel[1]) / (PLACE * diagonal);
        let angle = self.normal.angle(&other.normal).to_degrees() / ANGLE_DEG;
        [ratio, place, angle]
    }
}
