//! ROS camera_info, as camera_calibration_parsers reads and writes it.
//!
//! | key | contents |
//! |---|---|
//! | `image_width`, `image_height` | px |
//! | `camera_name` | `depthcal`; rename it to the driver's camera |
//! | `camera_matrix` | K, 3×3 without skew |
//! | `distortion_model` | `plumb_bob` (5), `rational_polynomial` (8) or `equidistant` (4) |
//! | `distortion_coefficients` | D, in OpenCV's order |
//! | `rectification_matrix` | R, the identity: one camera |
//! | `projection_matrix` | P, 3×4: K and a zero column, so that a rectified image has the same intrinsics |
//!
//! `rational_polynomial` with 12 or 14 coefficients is read; the messages' definition has 8.

use super::capability::{HeldLens, nearest};
use super::error::CameraFileError;
use super::export_camera::ExportCamera;
use super::intrinsics::{FileLens, Intrinsics};
use super::outcome::Export;
use super::text::list;
use super::yaml::Node;

const FORMAT: &str = "ROS camera_info";
const HELD: [HeldLens; 3] = [
    HeldLens { name: "plumb_bob", piece: "brown_conrady", count: 5 },
    HeldLens { name: "rational_polynomial", piece: "opencv_lens", count: 8 },
    HeldLens { name: "equidistant", piece: "kannala_brandt", count: 4 },
];

/// Whether a document is of this format.
pub(super) fn is_one(node: &Node<'_>) -> bool {
    node.has("distortion_model") && node.has("camera_matrix")
}

pub(super) fn read(node: &Node<'_>) -> Result<Intrinsics, CameraFileError> {
    const D: &str = "distortion_coefficients";
    let pinhole = node.camera_matrix("camera_matrix")?;
    let k = node.numbers(D)?.unwrap_or_default();
    let count = k.len();
    let counted = |lens: Option<FileLens>, expected: &str| {
        lens.map(Some).ok_or_else(|| node.fault(D, format!("has {count} numbers, expected {expected}")))
    };
    let lens = match node.required_text("distortion_model")? {
        _ if k.is_empty() => None,
        "plumb_bob" => counted(FileLens::opencv(&k).filter(|_| count <= 5), "4 or 5")?,
        "rational_polynomial" => counted(FileLens::opencv(&k).filter(|_| count >= 8), "8, 12 or 14")?,
        "equidistant" | "fisheye" => counted(k.try_into().ok().map(FileLens::fisheye), "4")?,
        model => {
            let known = "plumb_bob, rational_polynomial and equidistant";
            return Err(CameraFileError::Model { path: node.path.to_owned(), model: model.to_owned(), known });
        }
    };
    Ok(Intrinsics { size: node.size(["image_width", "image_height"])?, pinhole, lens })
}

pub(super) fn write(camera: &ExportCamera) -> Export {
    let mut written = nearest(&camera.camera, FORMAT, &HELD);
    let [fx, fy, cx, cy] = written.pinhole;
    let (width, height) = (camera.camera.width, camera.camera.height);
    let mut text = format!("image_width: {width}\nimage_height: {height}\ncamera_name: depthcal\n");
    text += &matrix("camera_matrix", 3, &[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]);
    text += &format!("distortion_model: {}\n", written.lens.name);
    text += &matrix("distortion_coefficients", 1, &written.values);
    text += &matrix("rectification_matrix", 3, &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
    text += &matrix("projection_matrix", 3, &[fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0]);
    written.warnings.extend(camera.depth_loss(FORMAT));
    Export { text, warnings: written.warnings }
}

fn matrix(key: &str, rows: usize, data: &[f64]) -> String {
    format!("{key}:\n  rows: {rows}\n  cols: {}\n  data: {}\n", data.len() / rows, list(data))
}
