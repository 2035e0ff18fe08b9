//! mrcal's .cameramodel, a Python dictionary, which is read as YAML.
//!
//! | key | contents |
//! |---|---|
//! | `lensmodel` | `LENSMODEL_OPENCV5`, `_OPENCV8`, `_OPENCV12` or `_CAHVOR`; read are also `_OPENCV4` and `_PINHOLE` |
//! | `intrinsics` | fx fy cx cy, then the coefficients |
//! | `extrinsics` | rt_cam_ref, zeros: the camera is its own reference |
//! | `imagersize` | width, height in px |

use super::capability::{HeldLens, nearest};
use super::error::CameraFileError;
use super::export_camera::ExportCamera;
use super::intrinsics::{FileLens, Intrinsics};
use super::node::Node;
use super::outcome::Export;
use super::text::list;

const FORMAT: &str = "mrcal";
const HELD: [HeldLens; 4] = [
    HeldLens { name: "LENSMODEL_OPENCV5", piece: "brown_conrady", count: 5 },
    HeldLens { name: "LENSMODEL_OPENCV8", piece: "opencv_lens", count: 8 },
    HeldLens { name: "LENSMODEL_OPENCV12", piece: "opencv_lens", count: 12 },
    HeldLens { name: "LENSMODEL_CAHVOR", piece: "cahvor", count: 5 },
];

/// The dictionary without the binary data that mrcal may append, and which is no YAML.
pub(super) fn without_binary(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut unread = text;
    while let Some(begin) = unread.find(" b'") {
        let after = &unread[begin + 3..];
        let Some(length) = after.find('\'') else { break };
        out.push_str(&unread[..begin]);
        out.push_str(" ''");
        unread = &after[length + 1..];
    }
    out + unread
}

/// The only camera of a document of this format.
pub(super) fn cameras(node: &Node<'_>) -> Vec<String> {
    if node.has("lensmodel") { vec![String::new()] } else { Vec::new() }
}

pub(super) fn read(node: &Node<'_>, _: &str) -> Result<Intrinsics, CameraFileError> {
    let model = node.required_text("lensmodel")?;
    let numbers = node.required_numbers("intrinsics")?;
    let count = match model {
        "LENSMODEL_PINHOLE" => 0,
        "LENSMODEL_OPENCV4" => 4,
        "LENSMODEL_OPENCV5" | "LENSMODEL_CAHVOR" => 5,
        "LENSMODEL_OPENCV8" => 8,
        "LENSMODEL_OPENCV12" => 12,
        _ => {
            let known = "LENSMODEL_PINHOLE, _OPENCV4, _OPENCV5, _OPENCV8, _OPENCV12 and _CAHVOR";
            return Err(CameraFileError::Model { path: node.path.to_owned(), model: model.to_owned(), known });
        }
    };
    let [fx, fy, cx, cy, k @ ..] = numbers.as_slice() else {
        return Err(node.fault("intrinsics", format!("has {} numbers, expected {}", numbers.len(), 4 + count)));
    };
    if k.len() != count || !(*fx > 0.0 && *fy > 0.0) {
        let problem = format!("has {} numbers, expected {} with positive focal lengths", numbers.len(), 4 + count);
        return Err(node.fault("intrinsics", problem));
    }
    let lens = match model {
        "LENSMODEL_CAHVOR" => Some(FileLens { piece: "cahvor", values: k.to_vec() }),
        _ => FileLens::opencv(k),
    };
    let size = node.size_list("imagersize")?;
    Ok(Intrinsics { size, pinhole: [*fx, *fy, *cx, *cy, 0.0], lens })
}

pub(super) fn write(camera: &ExportCamera) -> Export {
    let mut written = nearest(&camera.camera, FORMAT, &HELD);
    let names: &[&str] = match written.lens.piece {
        "cahvor" => &["alpha", "beta", "r0", "r1", "r2"],
        _ => &["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4"],
    };
    let mut intrinsics = written.pinhole.to_vec();
    intrinsics.extend(&written.values);
    let text = format!(
        "{{\n    'lensmodel': '{}',\n\n\
         \x20   # fx, fy, cx, cy, {}\n    'intrinsics': {},\n\n\
         \x20   # rt_cam_ref\n    'extrinsics': {},\n\n    'imagersize': [{}, {}],\n}}\n",
        written.lens.name,
        names[..written.values.len()].join(", "),
        list(&intrinsics),
        list(&[0.0; 6]),
        camera.camera.width,
        camera.camera.height
    );
    written.warnings.extend(camera.depth_loss(FORMAT));
    Export { text, warnings: written.warnings }
}
