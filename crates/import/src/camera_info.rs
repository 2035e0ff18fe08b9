//! Intrinsics that a recording carries.

use std::fmt::Write;
use std::path::Path;

use depthcal_io::camera_files::parse_camera;
use depthcal_io::{CameraHint, IntrinsicNumbers};

/// Intrinsics of a stream: `sensor_msgs/CameraInfo`, or the factory calibration of an Azure Kinect.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraInfo {
    /// Width of the image, px.
    pub width: usize,
    /// Height, px.
    pub height: usize,
    /// ROS' name of the lens model: `plumb_bob`, `rational_polynomial`, `equidistant`.
    pub model: String,
    /// Its coefficients in ROS' order.
    pub distortion: Vec<f64>,
    /// fx, fy, cx, cy, px; pixel centres at integers.
    pub pinhole: [f64; 4],
}

impl CameraInfo {
    /// Whether both are of one pixel grid: equal sizes, and centre and focal lengths equal to half a pixel and a thousandth.
    pub(crate) fn is_of_grid(&self, other: &Self) -> bool {
        let ([fx, fy, cx, cy], [gx, gy, dx, dy]) = (self.pinhole, other.pinhole);
        let focal = |f: f64, g: f64| (f / g - 1.0).abs() <= 1e-3;
        [self.width, self.height] == [other.width, other.height]
            && focal(fx, gx)
            && focal(fy, gy)
            && (cx - dx).abs().max((cy - dy).abs()) <= 0.5
    }

    /// The camera in a `dataset.toml`: numbers where the lens is Brown's and Conrady's, the file of this name otherwise. A lens
    /// that is not read is left out, and said.
    pub(crate) fn hint(&self, file: &str) -> CameraHint {
        let [fx, fy, cx, cy] = self.pinhole;
        let numbers = |distortion: Vec<f64>| CameraHint {
            numbers: Some(IntrinsicNumbers { fx, fy, cx, cy, skew: 0.0, distortion }),
            ..CameraHint::default()
        };
        if let Some(distortion) = self.brown_conrady() {
            return numbers(distortion.to_vec());
        }
        match parse_camera(Path::new(file), &self.yaml(""), None) {
            Ok(_) => CameraHint { intrinsics: Some(file.to_owned()), ..CameraHint::default() },
            Err(error) => {
                tracing::warn!("the lens is left out of the start values: {error}");
                numbers(Vec::new())
            }
        }
    }

    /// Whether a `dataset.toml` takes these numbers. Drivers without a calibration write zeros.
    pub(crate) fn is_plausible(&self) -> bool {
        let [fx, fy, cx, cy] = self.pinhole;
        let is_focal = |f: f64| (1.0..=1e5).contains(&f);
        self.width > 0
            && self.height > 0
            && is_focal(fx)
            && is_focal(fy)
            && cx.abs().max(cy.abs()) <= 1e5
            && self.distortion.iter().all(|k| k.abs() <= 1000.0)
    }

    /// Brown–Conrady k1 k2 p1 p2 k3 where the model is that.
    pub fn brown_conrady(&self) -> Option<[f64; 5]> {
        let mut five = [0.0; 5];
        let brown = self.model == "plumb_bob" || self.model.is_empty();
        if !brown || self.distortion.len() > 5 || self.distortion.iter().any(|k| !k.is_finite()) {
            return None;
        }
        five[..self.distortion.len()].copy_from_slice(&self.distortion);
        Some(five)
    }

    /// The YAML of ROS' `camera_calibration`.
    pub(crate) fn yaml(&self, name: &str) -> String {
        let [fx, fy, cx, cy] = self.pinhole;
        let matrix = |rows: usize, cols: usize, data: &[f64]| {
            let data: Vec<String> = data.iter().map(|v| format!("{v:?}")).collect();
            format!("  rows: {rows}\n  cols: {cols}\n  data: [{}]\n", data.join(", "))
        };
        let mut text = format!("image_width: {}\nimage_height: {}\ncamera_name: {name}\n", self.width, self.height);
        // Writing to a string cannot fail.
        let _ = write!(text, "camera_matrix:\n{}", matrix(3, 3, &[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]));
        let _ = writeln!(text, "distortion_model: {}", self.model);
        let _ = write!(text, "distortion_coefficients:\n{}", matrix(1, self.distortion.len(), &self.distortion));
        let _ = write!(text, "rectification_matrix:\n{}", matrix(3, 3, &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]));
        let projection = [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0];
        let _ = write!(text, "projection_matrix:\n{}", matrix(3, 4, &projection));
        text
    }
}
