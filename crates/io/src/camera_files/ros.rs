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
//! Such files are read by `matrix`, as are messages as `rostopic echo` (K, D) and `ros2 topic echo` (k, d) print them.
//! `rational_polynomial` with 12 or 14 coefficients is read; the messages' definition has 8.

use super::capability::{HeldLens, nearest};
use super::export_camera::ExportCamera;
use super::outcome::Export;
use super::text::list;

const FORMAT: &str = "ROS camera_info";
const HELD: [HeldLens; 3] = [
    HeldLens { name: "plumb_bob", piece: "brown_conrady", count: 5 },
    HeldLens { name: "rational_polynomial", piece: "opencv_lens", count: 8 },
    HeldLens { name: "equidistant", piece: "kannala_brandt", count: 4 },
];

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
