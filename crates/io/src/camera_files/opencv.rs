//! OpenCV's FileStorage, YAML 1.0.
//!
//! | key | contents |
//! |---|---|
//! | `image_width`, `image_height` | px |
//! | `camera_matrix` | 3×3: fx, 0, cx; 0, fy, cy; 0, 0, 1 |
//! | `distortion_coefficients` | 5, 8, 12 or 14×1, or 4×1 for a fisheye lens |
//! | `fisheye_model` | 1 for a fisheye lens, as OpenCV's calibration sample writes it |
//! | `depth_pieces` | depthcal's own, where there are any |
//!
//! The pieces are sequences of name, options (a sequence of name and value) and parameters (a sequence of name, unit and value).
//! OpenCV's functions ignore them. Read are also `K`, `cameraMatrix`, `D`, `distCoeffs` and `dist_coeffs`, and the coefficients
//! of `cv2` as 1×n.

use std::fmt::Write as _;

use super::capability::{HeldLens, nearest};
use super::error::CameraFileError;
use super::export_camera::ExportCamera;
use super::intrinsics::{FileLens, Intrinsics};
use super::outcome::Export;
use super::text::{list, number, quoted};
use super::yaml::Node;
use crate::record::PieceRecord;

const FORMAT: &str = "OpenCV";
const FISHEYE: HeldLens = HeldLens { name: "fisheye lens", piece: "kannala_brandt", count: 4 };
/// Lens models that OpenCV holds, the simplest first.
const HELD: [HeldLens; 5] = [
    HeldLens { name: "lens of 5 coefficients", piece: "brown_conrady", count: 5 },
    HeldLens { name: "lens of 8 coefficients", piece: "opencv_lens", count: 8 },
    HeldLens { name: "lens of 12 coefficients", piece: "opencv_lens", count: 12 },
    HeldLens { name: "lens of 14 coefficients", piece: "opencv_lens", count: 14 },
    FISHEYE,
];
const MATRICES: [&str; 4] = ["camera_matrix", "K", "cameraMatrix", "camera_Matrix"];
const COEFFICIENTS: [&str; 5] = ["distortion_coefficients", "D", "distCoeffs", "dist_coeffs", "distortion"];

/// Whether a document is of this format: it has a camera matrix.
pub(super) fn is_one(node: &Node<'_>) -> bool {
    MATRICES.iter().any(|name| node.has(name))
}

pub(super) fn read(node: &Node<'_>) -> Result<Intrinsics, CameraFileError> {
    let matrix = MATRICES.into_iter().find(|name| node.has(name)).unwrap_or(MATRICES[0]);
    let pinhole = node.camera_matrix(matrix)?;
    let coefficients = COEFFICIENTS.into_iter().find(|name| node.has(name));
    let is_fisheye = node.number("fisheye_model").is_some_and(|flag| flag != 0.0);
    let lens = match coefficients {
        None => None,
        Some(field) => {
            let k = node.required_numbers(field)?;
            let count = k.len();
            let lens = if is_fisheye { k.try_into().ok().map(FileLens::fisheye) } else { FileLens::opencv(&k) };
            let expected = if is_fisheye { "4" } else { "4, 5, 8, 12 or 14" };
            let problem = || node.fault(field, format!("has {count} numbers, expected {expected}"));
            if count == 0 { None } else { Some(lens.ok_or_else(problem)?) }
        }
    };
    let size = node.size(["image_width", "image_height"])?;
    Ok(Intrinsics { size, pinhole, lens })
}

pub(super) fn write(camera: &ExportCamera) -> Export {
    let written = nearest(&camera.camera, FORMAT, &HELD);
    let [fx, fy, cx, cy] = written.pinhole;
    let (width, height) = (camera.camera.width, camera.camera.height);
    let mut text = format!("%YAML:1.0\n---\nimage_width: {width}\nimage_height: {height}\n");
    if written.lens == FISHEYE {
        text += "fisheye_model: 1\n";
    }
    text += &matrix("camera_matrix", 3, 3, &[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]);
    text += &matrix("distortion_coefficients", written.values.len(), 1, &written.values);
    text += &pieces("depth_pieces", &camera.depth);
    Export { text, warnings: written.warnings }
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
