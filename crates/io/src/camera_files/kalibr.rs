//! Kalibr's camchain.
//!
//! | key | contents |
//! |---|---|
//! | `cam_overlaps` | empty: one camera, `cam0` |
//! | `camera_model`, `intrinsics` | `pinhole`, fx fy cx cy; or `omni`, ξ fx fy cx cy |
//! | `distortion_model`, `distortion_coeffs` | `radtan`, k1 k2 p1 p2; or `equi`, k1 k2 k3 k4 |
//! | `resolution` | width, height in px |
//! | `rostopic` | `/cam0/image_raw`; rename it to the camera's topic |
//!
//! `none` is read as a distortion model as well, and so are EuRoC's `radial-tangential` and `distortion_coefficients`.

use super::capability::{HeldLens, nearest};
use super::error::CameraFileError;
use super::export_camera::ExportCamera;
use super::intrinsics::{FileLens, Intrinsics};
use super::keys::{self, is_of_lens};
use super::lens_words::{LensModel, from_list, model_named};
use super::node::Node;
use super::outcome::Export;
use super::text::list;

const FORMAT: &str = "Kalibr";
const OMNI: HeldLens = HeldLens { name: "omni with radtan", piece: "unified", count: 5 };
const EQUI: HeldLens = HeldLens { name: "equi", piece: "kannala_brandt", count: 4 };
const HELD: [HeldLens; 3] = [HeldLens { name: "radtan", piece: "brown_conrady", count: 4 }, EQUI, OMNI];

/// The only camera of a mapping with a camera model and intrinsics: one of a camchain's, or EuRoC's `sensor.yaml`.
pub(super) fn cameras(node: &Node<'_>) -> Vec<String> {
    if node.has("camera_model") && node.is_list("intrinsics") { vec![String::new()] } else { Vec::new() }
}

pub(super) fn read(node: &Node<'_>, _: &str) -> Result<Intrinsics, CameraFileError> {
    // Kalibr's own options name both models in one word, `pinhole-radtan`.
    let named = node.required_text("camera_model")?;
    let (model, joined) = named.split_once('-').map_or((named, None), |(model, distortion)| (model, Some(distortion)));
    let distortion = joined.or(node.key(keys::LENS_MODEL).and_then(|key| node.text(key)));
    let lens = lens(node, distortion)?;
    let is_brown = lens.as_ref().is_none_or(|lens| lens.piece == "brown_conrady" && lens.values.len() == 4);
    let (pinhole, lens) = match model {
        "pinhole" => (node.array::<4>("intrinsics")?, lens),
        "omni" if is_brown => {
            let [xi, fx, fy, cx, cy] = node.array::<5>("intrinsics")?;
            let values = std::iter::once(xi).chain(lens.map_or(vec![0.0; 4], |lens| lens.values)).collect();
            ([fx, fy, cx, cy], Some(FileLens { piece: "unified", values }))
        }
        "omni" => {
            let model = format!("omni with {}", distortion.unwrap_or("none"));
            return Err(node.unsupported(&model, "omni with radtan or none"));
        }
        other => return Err(node.unsupported(other, "pinhole and omni")),
    };
    let [fx, fy, cx, cy] = pinhole;
    node.focal_lengths("intrinsics", [fx, fy])?;
    Ok(Intrinsics { size: node.size()?, pinhole: [fx, fy, cx, cy, 0.0], lens })
}

/// The lens of a distortion model; without a name or coefficients a camera has none.
fn lens(node: &Node<'_>, distortion: Option<&str>) -> Result<Option<FileLens>, CameraFileError> {
    let field = node.key(keys::COEFFICIENTS);
    let model = match distortion {
        Some(name) => model_named(name).ok_or_else(|| node.unsupported(name, "radtan, equi and none"))?,
        None if node.keys().into_iter().any(is_of_lens) => return Err(node.without_lens("intrinsics")),
        None => return Ok(None),
    };
    match field {
        Some(field) => from_list(node, field, Some(model)),
        None if model == LensModel::Undistorted => Ok(None),
        None => Err(node.fault("distortion_coeffs", "is missing, expected 4 numbers")),
    }
}

pub(super) fn write(camera: &ExportCamera) -> Export {
    let mut written = nearest(&camera.camera, FORMAT, &HELD);
    let (mut model, mut intrinsics, mut distortion, mut values) =
        ("pinhole", written.pinhole.to_vec(), written.lens.name, written.values.as_slice());
    if written.lens == OMNI {
        (model, distortion, values) = ("omni", "radtan", &written.values[1..]);
        intrinsics.insert(0, written.values[0]);
    }
    let text = format!(
        "cam0:\n  cam_overlaps: []\n  camera_model: {model}\n  distortion_coeffs: {}\n  distortion_model: {distortion}\n  \
         intrinsics: {}\n  resolution: [{}, {}]\n  rostopic: /cam0/image_raw\n",
        list(values),
        list(&intrinsics),
        camera.camera.width,
        camera.camera.height
    );
    written.warnings.extend(camera.depth_loss(FORMAT));
    Export { text, warnings: written.warnings }
}
