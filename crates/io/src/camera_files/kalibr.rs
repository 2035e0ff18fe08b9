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
//! `none` is read as a distortion model as well.

use super::capability::{HeldLens, nearest};
use super::error::CameraFileError;
use super::export_camera::ExportCamera;
use super::intrinsics::{FileLens, Intrinsics};
use super::outcome::Export;
use super::text::list;
use super::yaml::Node;

const FORMAT: &str = "Kalibr";
const OMNI: HeldLens = HeldLens { name: "omni with radtan", piece: "unified", count: 5 };
const EQUI: HeldLens = HeldLens { name: "equi", piece: "kannala_brandt", count: 4 };
const HELD: [HeldLens; 3] = [HeldLens { name: "radtan", piece: "brown_conrady", count: 4 }, EQUI, OMNI];

/// Names of the cameras in a document: its mappings that have a camera model.
pub(super) fn cameras<'a>(node: &Node<'a>) -> Vec<&'a str> {
    node.mappings().into_iter().filter(|name| node.node(name).is_some_and(|c| c.has("camera_model"))).collect()
}

pub(super) fn read(node: &Node<'_>) -> Result<Intrinsics, CameraFileError> {
    const COEFFICIENTS: &str = "distortion_coeffs";
    let unsupported =
        |model: &str, known| CameraFileError::Model { path: node.path.to_owned(), model: model.to_owned(), known };
    let distortion = node.text("distortion_model").unwrap_or("none");
    let radtan = || match distortion {
        "radtan" => node.array::<4>(COEFFICIENTS),
        "none" => Ok([0.0; 4]),
        other => Err(unsupported(&format!("omni with {other}"), "omni with radtan or none")),
    };
    let (pinhole, lens) = match node.required_text("camera_model")? {
        "pinhole" => {
            let lens = match distortion {
                "none" => None,
                "radtan" => FileLens::opencv(&node.array::<4>(COEFFICIENTS)?),
                "equi" => Some(FileLens::fisheye(node.array(COEFFICIENTS)?)),
                other => return Err(unsupported(other, "radtan, equi and none")),
            };
            (node.array::<4>("intrinsics")?, lens)
        }
        "omni" => {
            let [xi, fx, fy, cx, cy] = node.array::<5>("intrinsics")?;
            let values = std::iter::once(xi).chain(radtan()?).collect();
            ([fx, fy, cx, cy], Some(FileLens { piece: "unified", values }))
        }
        other => return Err(unsupported(other, "pinhole and omni")),
    };
    let [fx, fy, cx, cy] = pinhole;
    if !(fx > 0.0 && fy > 0.0) {
        return Err(node.fault("intrinsics", format!("have the focal lengths {fx} and {fy}, expected positive ones")));
    }
    let size = node.size_list("resolution")?;
    Ok(Intrinsics { size, pinhole: [fx, fy, cx, cy, 0.0], lens })
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
