//! `transforms.json` of instant-ngp and nerfstudio.
//!
//! | key | contents |
//! |---|---|
//! | `w`, `h`, `fl_x`, `fl_y`, `cx`, `cy` | px; the centre of the first pixel is (0.5, 0.5), as in COLMAP, which is converted |
//! | `k1`, `k2`, `p1`, `p2`, `k3` | of OpenCV's model; zero where they are not there |
//! | `camera_model` | `OPENCV`, `OPENCV_FISHEYE` (k1 … k4) or `PINHOLE`; `is_fisheye` in instant-ngp |
//! | `frames` | written empty |
//!
//! nerfstudio's k4 of a lens that is no fisheye belongs to r⁸, and is refused unless it is zero. Source: nerfstudio's
//! camera_utils.py, `_compute_residual_and_jacobian`; instant-ngp's colmap2nerf.py.

use super::capability::{HeldLens, nearest};
use super::error::CameraFileError;
use super::export_camera::ExportCamera;
use super::intrinsics::Intrinsics;
use super::keys::plain;
use super::lens_words::optional;
use super::node::Node;
use super::outcome::Export;
use super::text::number;

const FORMAT: &str = "nerf transforms";
const FISHEYE: HeldLens = HeldLens { name: "OPENCV_FISHEYE", piece: "kannala_brandt", count: 4 };
const HELD: [HeldLens; 2] = [HeldLens { name: "OPENCV", piece: "brown_conrady", count: 4 }, FISHEYE];
/// Models that are read; k1 … of those that have fewer terms stand alone.
const MODELS: [&str; 6] = ["OPENCV", "OPENCV_FISHEYE", "PINHOLE", "SIMPLE_PINHOLE", "RADIAL", "SIMPLE_RADIAL"];
/// Position of the first pixel's centre, px.
const FIRST_PIXEL: f64 = 0.5;

/// The only camera of a mapping: `fl_x` is this format's alone.
pub(super) fn cameras(node: &Node<'_>) -> Vec<String> {
    if node.keys().into_iter().any(|key| plain(key) == "flx") { vec![String::new()] } else { Vec::new() }
}

pub(super) fn read(node: &Node<'_>, _: &str) -> Result<Intrinsics, CameraFileError> {
    let [fx, fy, cx, cy, skew] = node.named_pinhole()?;
    let model = node.text("camera_model").unwrap_or("OPENCV");
    if !MODELS.contains(&model) {
        return Err(
            node.unsupported(model, "OPENCV, OPENCV_FISHEYE, PINHOLE, SIMPLE_PINHOLE, RADIAL and SIMPLE_RADIAL")
        );
    }
    let lens = optional(node, "fl_x")?;
    Ok(Intrinsics { size: node.size()?, pinhole: [fx, fy, cx - FIRST_PIXEL, cy - FIRST_PIXEL, skew], lens })
}

pub(super) fn write(camera: &ExportCamera) -> Export {
    let mut written = nearest(&camera.camera, FORMAT, &HELD);
    let [fx, fy, cx, cy] = written.pinhole;
    let names = if written.lens == FISHEYE { ["k1", "k2", "k3", "k4"] } else { ["k1", "k2", "p1", "p2"] };
    let numbers = [("fl_x", fx), ("fl_y", fy), ("cx", cx + FIRST_PIXEL), ("cy", cy + FIRST_PIXEL)];
    let lens = names.into_iter().zip(written.values.iter().copied());
    let fields: String =
        numbers.into_iter().chain(lens).map(|(name, value)| format!("  \"{name}\": {},\n", number(value))).collect();
    let text = format!(
        "{{\n  \"camera_model\": \"{}\",\n  \"is_fisheye\": {},\n  \"w\": {},\n  \"h\": {},\n{fields}  \"frames\": []\n}}\n",
        written.lens.name,
        written.lens == FISHEYE,
        camera.camera.width,
        camera.camera.height
    );
    written.warnings.extend(camera.depth_loss(FORMAT));
    Export { text, warnings: written.warnings }
}
