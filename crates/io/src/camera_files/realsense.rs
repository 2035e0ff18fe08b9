//! RealSense's `rs2_intrinsics`, in JSON.
//!
//! | key | contents |
//! |---|---|
//! | `width`, `height` | px |
//! | `fx`, `fy`, `ppx`, `ppy` | px; pixel centres at integers |
//! | `model` | `distortion.` or `RS2_DISTORTION_` and one of the names below; `none` without a lens |
//! | `coeffs` | k1 k2 p1 p2 k3 (`brown_conrady`, `inverse_…`, `modified_…`), or k1 k2 k3 k4 0 (`kannala_brandt4`) |
//!
//! **Modified and inverse.** `rs2_project_point_to_pixel` (rs.cpp) takes both from undistorted rays to pixels, with the
//! decentring at the radially distorted point: x' = f x + 2 p1 (f x)(f y) + p2 (r² + 2 (f x)²); since 2.45
//! `rs2_deproject_pixel_to_point` is the inverse of that (librealsense 8523). Brown's and Conrady's lens has x and y there, which
//! is the same where p1 = p2 = 0. It is read as that lens where it differs by less than 0.05 px over the image, and refused where
//! it does not.

use super::capability::{HeldLens, nearest};
use super::error::CameraFileError;
use super::export_camera::ExportCamera;
use super::intrinsics::Intrinsics;
use super::keys::{self, plain};
use super::named;
use super::node::Node;
use super::outcome::Export;
use super::text::{list, number};

const FORMAT: &str = "RealSense";
const FISHEYE: HeldLens = HeldLens { name: "kannala_brandt4", piece: "kannala_brandt", count: 4 };
const HELD: [HeldLens; 2] = [HeldLens { name: "brown_conrady", piece: "brown_conrady", count: 5 }, FISHEYE];
/// Largest difference between the modified and Brown's and Conrady's lens that is read, px.
const LARGEST_PX: f64 = 0.05;

/// The only camera of a mapping: `ppx` is RealSense's alone.
pub(super) fn cameras(node: &Node<'_>) -> Vec<String> {
    if node.has("ppx") && node.has("ppy") { named::cameras(node) } else { Vec::new() }
}

pub(super) fn read(node: &Node<'_>, name: &str) -> Result<Intrinsics, CameraFileError> {
    let camera = named::read(node, name)?;
    let model = node.key(keys::CAMERA_MODEL).and_then(|key| node.text(key)).map(plain).unwrap_or_default();
    if model.contains("modified") || model.contains("inverse") {
        let difference = modified_px(&camera);
        if difference > LARGEST_PX {
            let problem = format!(
                "differs by {difference:.2} px from Brown's and Conrady's lens, and is not read: calibrate the camera, or \
                 write its `coeffs` as brown_conrady"
            );
            return Err(node.fault("model", problem));
        }
    }
    Ok(camera)
}

/// Largest distance over the image between the pixels of the modified and of Brown's and Conrady's lens, px.
fn modified_px(camera: &Intrinsics) -> f64 {
    let ([fx, fy, cx, cy, _], Some(lens)) = (camera.pinhole, &camera.lens) else { return 0.0 };
    let [width, height] = camera.size.unwrap_or([(2.0 * cx) as usize, (2.0 * cy) as usize]).map(|n| n as f64);
    let k = |i: usize| lens.values.get(i).copied().unwrap_or_default();
    let difference = |[u, v]: [f64; 2]| {
        let [x, y] = [(u - cx) / fx, (v - cy) / fy];
        let r2 = x * x + y * y;
        let f = 1.0 + k(0) * r2 + k(1) * r2 * r2 + k(4) * r2 * r2 * r2;
        let scale = f * f - 1.0;
        let dx = fx * scale * (2.0 * k(2) * x * y + 2.0 * k(3) * x * x);
        dx.hypot(fy * scale * (2.0 * k(3) * x * y + 2.0 * k(2) * y * y))
    };
    let share = |i: usize| f64::from(i as u32) / 8.0;
    let grid = (0..81).map(|i| [share(i % 9) * width, share(i / 9) * height]);
    grid.map(difference).fold(0.0, f64::max)
}

pub(super) fn write(camera: &ExportCamera) -> Export {
    let mut written = nearest(&camera.camera, FORMAT, &HELD);
    let [fx, fy, cx, cy] = written.pinhole.map(number);
    let mut coefficients = written.values.clone();
    coefficients.resize(5, 0.0);
    let text = format!(
        "{{\n  \"width\": {},\n  \"height\": {},\n  \"fx\": {fx},\n  \"fy\": {fy},\n  \"ppx\": {cx},\n  \"ppy\": {cy},\n  \"model\": \
         \"distortion.{}\",\n  \"coeffs\": {}\n}}\n",
        camera.camera.width,
        camera.camera.height,
        written.lens.name,
        list(&coefficients)
    );
    written.warnings.extend(camera.depth_loss(FORMAT));
    Export { text, warnings: written.warnings }
}
