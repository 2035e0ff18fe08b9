//! Intrinsics that a recording carries.

use std::fmt::Write;
use std::path::Path;

use depthcal_io::camera_files::parse_camera;
use depthcal_io::{CameraHint, IntrinsicNumbers};

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
    /// Reads a message of an image that is reduced and cut out as it says.
    ///
    /// # Errors
    /// That the message is cut off, that the camera was not calibrated, or that its numbers are no camera's.
    pub(crate) fn read(fields: Fields<'_>) -> Result<Self, String> {
        let info = Self::fields(fields).ok_or("a message is cut off or not of its type")?;
        if info.pinhole[..2] == [0.0; 2] {
            return Err("its focal lengths are zero: the driver has no calibration".to_owned());
        }
        if !info.is_plausible() {
            let [fx, fy, cx, cy] = info.pinhole;
            return Err(format!("focal lengths of {fx}, {fy} px and the centre {cx}, {cy} px are no camera's"));
        }
        Ok(info)
    }

    /// `sensor_msgs/CameraInfo`. K is of the whole image; binning divides it, after the region of interest was cut out
    /// (image_geometry's PinholeCameraModel).
    fn fields(mut fields: Fields<'_>) -> Option<Self> {
        fields.header()?;
        let (height, width) = (fields.u32()? as usize, fields.u32()? as usize);
        let model = fields.string()?;
        let distortion = fields.f64s()?;
        let mut k = [0.0; 9];
        for entry in &mut k {
            *entry = fields.f64()?;
        }
        // R and P are of rectified images.
        for _ in 0..9 + 12 {
            fields.f64()?;
        }
        let binning = [fields.u32()?, fields.u32()?].map(|b| b.max(1) as usize);
        let [left, top, roi_height, roi_width] = [fields.u32()?, fields.u32()?, fields.u32()?, fields.u32()?];
        let size = |roi: u32, whole: usize| if roi == 0 { whole } else { roi as usize };
        let (width, height) = (size(roi_width, width) / binning[0], size(roi_height, height) / binning[1]);
        let [bx, by] = binning.map(|b| b as f64);
        let pinhole = [k[0] / bx, k[4] / by, (k[2] - f64::from(left)) / bx, (k[5] - f64::from(top)) / by];
        Some(CameraInfo { width, height, model, distortion, pinhole })
    }

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
