//! Open3D's `PinholeCameraIntrinsic`, in JSON, alone or in a `PinholeCameraParameters` or a trajectory.
//!
//! | key | contents |
//! |---|---|
//! | `width`, `height` | px |
//! | `intrinsic_matrix` | fx 0 0, 0 fy 0, cx cy 1: **column by column**, as Eigen holds it; pixel centres at integers |
//!
//! Open3D has no lens: images are undistorted beforehand. Source: `PinholeCameraIntrinsic::ConvertToJsonValue`.

use super::capability::{HeldLens, nearest};
use super::error::CameraFileError;
use super::export_camera::ExportCamera;
use super::intrinsics::Intrinsics;
use super::keys::is_of_lens;
use super::lens_words::optional;
use super::node::Node;
use super::outcome::Export;
use super::text::list;

const FORMAT: &str = "Open3D";
const HELD: [HeldLens; 1] = [HeldLens { name: "camera without a lens", piece: "brown_conrady", count: 0 }];
const MATRIX: &str = "intrinsic_matrix";

/// The only camera of a mapping whose matrix has the principal point by columns, or has none and the mapping no lens.
pub(super) fn cameras(node: &Node<'_>) -> Vec<String> {
    let has_lens = || node.keys().into_iter().any(is_of_lens);
    let by_columns = |k: [f64; 9]| [k[2], k[5]] == [0.0; 2] && ([k[6], k[7]] != [0.0; 2] || !has_lens());
    if node.array(MATRIX).is_ok_and(by_columns) { vec![String::new()] } else { Vec::new() }
}

pub(super) fn read(node: &Node<'_>, _: &str) -> Result<Intrinsics, CameraFileError> {
    let [fx, below, _, skew, fy, _, cx, cy, one] = node.array::<9>(MATRIX)?;
    if below != 0.0 || one != 1.0 {
        return Err(node.fault(MATRIX, "is no camera matrix fx 0 0, s fy 0, cx cy 1 by columns"));
    }
    node.focal_lengths(MATRIX, [fx, fy])?;
    Ok(Intrinsics { size: node.size()?, pinhole: [fx, fy, cx, cy, skew], lens: optional(node, MATRIX)? })
}

pub(super) fn write(camera: &ExportCamera) -> Export {
    let mut written = nearest(&camera.camera, FORMAT, &HELD);
    let [fx, fy, cx, cy] = written.pinhole;
    let text = format!(
        "{{\n  \"width\": {},\n  \"height\": {},\n  \"{MATRIX}\": {}\n}}\n",
        camera.camera.width,
        camera.camera.height,
        list(&[fx, 0.0, 0.0, 0.0, fy, 0.0, cx, cy, 1.0])
    );
    written.warnings.extend(camera.depth_loss(FORMAT));
    Export { text, warnings: written.warnings }
}
