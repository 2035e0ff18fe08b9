//! OpenCV's FileStorage, YAML 1.0.

use std::fmt::Write as _;

use super::camera::ExportCamera;
use super::error::ExportError;
use super::outcome::{Export, ExportWarning};
use super::text::{list, number, quoted};
use crate::record::PieceRecord;

/// OpenCV's calibration file, for `cv::FileStorage`.
///
/// | key | contents |
/// |---|---|
/// | `image_width`, `image_height` | px |
/// | `camera_matrix` | 3×3: fx, skew, cx; 0, fy, cy; 0, 0, 1 |
/// | `distortion_coefficients` | 5×1: k1 k2 p1 p2 k3 |
/// | `lens_pieces`, `depth_pieces` | depthcal's own, where there are any |
///
/// The pieces are sequences of name, options (a sequence of name and value) and parameters (a sequence of name, unit
/// and value). OpenCV's functions ignore the skew and these pieces; skew and lens pieces give warnings, as they would
/// move pixels.
///
/// # Errors
/// [`ExportError::Value`] when a number is not finite, or size or focal length are not positive.
pub fn opencv_yaml(camera: &ExportCamera) -> Result<Export, ExportError> {
    const FORMAT: &str = "OpenCV";
    camera.check()?;
    let mut text = format!("%YAML:1.0\n---\nimage_width: {}\nimage_height: {}\n", camera.width, camera.height);
    let k = [camera.fx, camera.skew, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0];
    text += &matrix("camera_matrix", 3, 3, &k);
    text += &matrix("distortion_coefficients", 5, 1, &camera.distortion);
    text += &pieces("lens_pieces", &camera.lens);
    text += &pieces("depth_pieces", &camera.depth);

    let mut warnings = Vec::new();
    if camera.skew != 0.0 {
        warnings.push(ExportWarning::Skew { format: FORMAT, value: camera.skew, written: true });
    }
    warnings.extend(camera.lens_loss(FORMAT));
    Ok(Export { text, warnings })
}

fn matrix(key: &str, rows: usize, columns: usize, data: &[f64]) -> String {
    let data = list(data);
    format!("{key}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   data: {data}\n")
}

fn pieces(key: &str, pieces: &[PieceRecord]) -> String {
    if pieces.is_empty() {
        return String::new();
    }
    let mut text = format!("{key}:\n");
    for piece in pieces {
        // Writing to a string cannot fail.
        let _ = write!(text, "   -\n      name: {}\n", quoted(&piece.name));
        if !piece.options.is_empty() {
            text += "      options:\n";
            for (name, value) in &piece.options {
                let _ = writeln!(text, "         - {{ name: {}, value: {} }}", quoted(name), number(*value));
            }
        }
        text += "      parameters:\n";
        for parameter in &piece.parameters {
            let (name, unit) = (quoted(&parameter.name), quoted(&parameter.unit));
            let value = number(parameter.value);
            let _ = writeln!(text, "         - {{ name: {name}, unit: {unit}, value: {value} }}");
        }
    }
    text
}
