//! The lenses that RealSense calls modified and inverse Brown–Conrady.
//!
//! `rs2_project_point_to_pixel` (librealsense, rs.cpp) takes both from undistorted rays to pixels, with the decentring at the
//! radially distorted point: x' = f x + 2 p1 (f x)(f y) + p2 (r² + 2 (f x)²), f = 1 + k1 r² + k2 r⁴ + k3 r⁶; its inverse,
//! `rs2_deproject_pixel_to_point`, agrees since librealsense's pull request 8523. Brown's and Conrady's lens has x and y there,
//! which is equal where p1 = p2 = 0. It is read as that lens where it differs by less than 0.05 px over the image.

use super::error::CameraFileError;
use super::intrinsics::Intrinsics;
use super::keys::{self, plain};
use super::node::Node;

/// Largest difference that is read, px.
const LARGEST_PX: f64 = 0.05;

/// Whether a mapping names one of these lenses, and in which field.
pub(super) fn named<'a>(node: &Node<'a>) -> Option<&'a str> {
    let field = node.key(keys::LENS_MODEL).or(node.key(keys::CAMERA_MODEL))?;
    let model = plain(node.text(field)?);
    (model.ends_with("modifiedbrownconrady") || model.ends_with("inversebrownconrady")).then_some(field)
}

/// Refuses a camera whose lens a mapping names so, and which Brown's and Conrady's lens does not hold.
pub(super) fn check(node: &Node<'_>, camera: &Intrinsics) -> Result<(), CameraFileError> {
    let Some(field) = named(node) else { return Ok(()) };
    let difference = difference_px(camera);
    if difference <= LARGEST_PX {
        return Ok(());
    }
    let problem = format!(
        "differs by {difference:.2} px from Brown's and Conrady's lens, and is not read: calibrate the camera, or write \
         brown_conrady where its coefficients are that lens'"
    );
    Err(node.fault(field, problem))
}

/// Largest distance over the image between the pixels of the modified and of Brown's and Conrady's lens, px.
fn difference_px(camera: &Intrinsics) -> f64 {
    let ([fx, fy, cx, cy, _], Some(lens)) = (camera.pinhole, &camera.lens) else { return 0.0 };
    let [width, height] = camera.size.map_or([2.0 * cx, 2.0 * cy], |size| size.map(|side| side as f64));
    let k = |i: usize| lens.values.get(i).copied().unwrap_or_default();
    let difference = |[u, v]: [f64; 2]| {
        let [x, y] = [(u - cx) / fx, (v - cy) / fy];
        let r2 = x * x + y * y;
        let f = 1.0 + k(0) * r2 + k(1) * r2 * r2 + k(4) * r2 * r2 * r2;
        let scale = f * f - 1.0;
        let dx = fx * scale * (2.0 * k(2) * x * y + 2.0 * k(3) * x * x);
        dx.hypot(fy * scale * (2.0 * k(3) * x * y + 2.0 * k(2) * y * y))
    };
    let share = |i: u32| f64::from(i) / 8.0;
    (0..81).map(|i| difference([share(i % 9) * width, share(i / 9) * height])).fold(0.0, f64::max)
}
