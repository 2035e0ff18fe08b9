//! RealSense's `rs2_intrinsics`, in JSON.
//!
//! | key | contents |
//! |---|---|
//! | `width`, `height` | px |
//! | `fx`, `fy`, `ppx`, `ppy` | px; pixel centres at integers |
//! | `model` | `distortion.` or `RS2_DISTORTION_` and one of the names below; `none` without a lens |
//! | `coeffs` | k1 k2 p1 p2 k3 (`brown_conrady`, `inverse_…`, `modified_…`), or k1 k2 k3 k4 0 (`kannala_brandt4`) |
//!
//! `modified_lens` says what its modified and inverse lenses are.

use super::capability::{HeldLens, nearest};
use super::error::CameraFileError;
use super::export_camera::ExportCamera;
use super::intrinsics::Intrinsics;
use super::keys;
use super::lens_words::model_named;
use super::named;
use super::node::Node;
use super::outcome::Export;
use super::text::{list, number};

const FORMAT: &str = "RealSense";
const FISHEYE: HeldLens = HeldLens { name: "kannala_brandt4", piece: "kannala_brandt", count: 4 };
const HELD: [HeldLens; 2] = [HeldLens { name: "brown_conrady", piece: "brown_conrady", count: 5 }, FISHEYE];
/// Models that are read, for errors.
const KNOWN: &str = "brown_conrady, modified_brown_conrady, inverse_brown_conrady, kannala_brandt4 and none";

/// The only camera of a mapping: `ppx` is RealSense's alone.
pub(super) fn cameras(node: &Node<'_>) -> Vec<String> {
    if node.has("ppx") && node.has("ppy") { named::cameras(node) } else { Vec::new() }
}

pub(super) fn read(node: &Node<'_>, name: &str) -> Result<Intrinsics, CameraFileError> {
    let camera = named::read(node, name)?;
    let is_distorted = camera.lens.as_ref().is_some_and(|lens| lens.values.iter().any(|k| *k != 0.0));
    let model = node.key(keys::CAMERA_MODEL).and_then(|key| node.text(key));
    match model.map(model_named) {
        None if is_distorted => {
            Err(node.fault("model", "is missing, expected a name such as distortion.brown_conrady"))
        }
        Some(None) => Err(node.unsupported(model.unwrap_or_default(), KNOWN)),
        _ => Ok(camera),
    }
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
