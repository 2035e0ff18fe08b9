//! ROS camera_info.

use super::camera::ExportCamera;
use super::error::ExportError;
use super::outcome::Export;
use super::text::list;

/// A camera_info file as ROS' camera_calibration_parsers reads it.
///
/// | key | contents |
/// |---|---|
/// | `image_width`, `image_height` | px |
/// | `camera_name` | `depthcal`; rename it to the driver's camera |
/// | `camera_matrix` | K, 3×3 without skew |
/// | `distortion_model` | `plumb_bob` |
/// | `distortion_coefficients` | D, 1×5: k1 k2 p1 p2 k3 |
/// | `rectification_matrix` | R, the identity: one camera |
/// | `projection_matrix` | P, 3×4: K and a zero column, so that a rectified image has the same intrinsics |
///
/// Skew, depth model and further lens pieces give warnings.
///
/// # Errors
/// [`ExportError::Value`] when a number is not finite, or size or focal length are not positive.
pub fn ros_camera_info(camera: &ExportCamera) -> Result<Export, ExportError> {
    camera.check()?;
    let ExportCamera { width, height, fx, fy, cx, cy, .. } = *camera;
    let mut text = format!("image_width: {width}\nimage_height: {height}\ncamera_name: depthcal\n");
    text += &matrix("camera_matrix", 3, &[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]);
    text += "distortion_model: plumb_bob\n";
    text += &matrix("distortion_coefficients", 1, &camera.distortion);
    text += &matrix("rectification_matrix", 3, &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
    text += &matrix("projection_matrix", 3, &[fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0]);
    Ok(Export { text, warnings: camera.losses("ROS camera_info") })
}

fn matrix(key: &str, rows: usize, data: &[f64]) -> String {
    format!("{key}:\n  rows: {rows}\n  cols: {}\n  data: {}\n", data.len() / rows, list(data))
}
