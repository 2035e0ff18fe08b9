//! Markers with the depth measured around them: what the thesis' estimators use.

use depthcal_model::{Camera, Target};
use nalgebra::{Isometry3, Vector3, Vector4};

use crate::observe::DetectedFrame;
use crate::observe::board_pixels::BoardPixel;
use crate::observe::marker_depth::marker_inverse_depths;

/// A marker with depth: everything that the thesis' estimators use of it.
#[derive(Debug, Clone, Copy)]
pub struct MarkerPoint {
    /// Its defined position in the camera frame, mm.
    pub point_in_camera: Vector3<f64>,
    /// Ray of its image, undistorted (X/Z, Y/Z).
    pub ray: [f64; 2],
    /// Measured inverse depth there, 1/mm.
    pub inverse_depth: f64,
}

/// Markers of a frame with the depth measured at them, from the board pixels around (see
/// [`crate::observe::board_pixels::board_pixels`]) under a camera and a pose from the image. `None` where the depth around a
/// marker is missing.
pub fn marker_points(
    frame: &DetectedFrame,
    pixels: &[BoardPixel],
    camera: &Camera,
    target: &Target,
    camera_from_board: &Isometry3<f64>,
) -> Vec<Option<MarkerPoint>> {
    let rays: Vec<(usize, [f64; 2])> =
        frame.markers.iter().map(|m| (m.index, camera.ray(m.pixel, 1e-3).unwrap_or([f64::NAN; 2]))).collect();
    let depths = marker_inverse_depths(target, &rays, pixels);
    rays.iter()
        .zip(depths)
        .map(|((index, ray), depth)| {
            let p = camera.board_point(target.point(*index));
            let point_in_camera = (camera_from_board * nalgebra::Point3::from(p)).coords;
            depth.map(|inverse_depth| MarkerPoint { point_in_camera, ray: *ray, inverse_depth })
        })
        .collect()
}

/// D = (dx, dy, dz, dw), held entries at their nominal values.
pub(crate) fn nominal() -> Vector4<f64> {
    Vector4::new(0.0, 0.0, 0.0, 1.0)
}
