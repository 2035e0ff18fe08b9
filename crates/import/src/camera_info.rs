//! Intrinsics that a recording carries.

use std::fmt::Write;

use crate::fields::Fields;

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
    /// Reads a message; `None` where it is cut off, or its numbers are no camera's.
    pub(crate) fn read(mut fields: Fields<'_>) -> Option<Self> {
        fields.header()?;
        let (height, width) = (fields.u32()? as usize, fields.u32()? as usize);
        let model = fields.string()?;
        let distortion = fields.f64s()?;
        let mut k = [0.0; 9];
        for entry in &mut k {
            *entry = fields.f64()?;
        }
        let pinhole = [k[0], k[4], k[2], k[5]];
        Some(CameraInfo { width, height, model, distortion, pinhole }).filter(CameraInfo::is_plausible)
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
