//! camodocal's cameras, which VINS-Mono, VINS-Fusion and their successors read.
//!
//! | `model_type` | `projection_parameters` | `distortion_parameters` |
//! |---|---|---|
//! | `PINHOLE` | fx fy cx cy | k1 k2 p1 p2 |
//! | `PINHOLE_FULL` | fx fy cx cy | k1 … k6 p1 p2 |
//! | `KANNALA_BRANDT` | k2 k3 k4 k5, which are k1 … k4 elsewhere; mu mv u0 v0 | – |
//! | `MEI` | gamma1 gamma2 u0 v0; `mirror_parameters` xi | k1 k2 p1 p2 |
//!
//! Pixel centres are at integers. Source: CameraFactory.cc, EquidistantCamera.cc (r = θ + k2 θ³ + k3 θ⁵ + …) and CataCamera.cc.

use super::capability::{HeldLens, nearest};
use super::error::CameraFileError;
use super::export_camera::ExportCamera;
use super::intrinsics::{FileLens, Intrinsics};
use super::lens_words::{LensModel, from_terms};
use super::node::Node;
use super::outcome::Export;
use super::text::number;

const FORMAT: &str = "camodocal";
const FISHEYE: HeldLens = HeldLens { name: "KANNALA_BRANDT", piece: "kannala_brandt", count: 4 };
const MEI: HeldLens = HeldLens { name: "MEI", piece: "unified", count: 5 };
const HELD: [HeldLens; 4] = [
    HeldLens { name: "PINHOLE", piece: "brown_conrady", count: 4 },
    HeldLens { name: "PINHOLE_FULL", piece: "opencv_lens", count: 8 },
    FISHEYE,
    MEI,
];
const PROJECTION: &str = "projection_parameters";
const DISTORTION: &str = "distortion_parameters";

/// The only camera of a mapping.
pub(super) fn cameras(node: &Node<'_>) -> Vec<String> {
    if node.has("model_type") && node.node(PROJECTION).is_some() { vec![String::new()] } else { Vec::new() }
}

pub(super) fn read(node: &Node<'_>, _: &str) -> Result<Intrinsics, CameraFileError> {
    let part = |name: &str| node.node(name).ok_or_else(|| node.fault(name, "is missing"));
    let projection = part(PROJECTION)?;
    let required = |node: &Node<'_>, field: &str| {
        node.quantity(&[field])?.ok_or_else(|| node.fault(field, "is missing, expected a number"))
    };
    let terms = |model| {
        let distortion = part(DISTORTION)?;
        from_terms(&distortion, Some(model))?.ok_or_else(|| distortion.without_lens("k1"))
    };
    let lens = match node.required_text("model_type")? {
        "PINHOLE" => terms(LensModel::BrownConrady)?,
        "PINHOLE_FULL" => terms(LensModel::Rational)?,
        "KANNALA_BRANDT" => {
            let k = |field| required(&projection, field);
            FileLens::fisheye([k("k2")?, k("k3")?, k("k4")?, k("k5")?])
        }
        "MEI" => {
            let k = terms(LensModel::BrownConrady)?.values;
            let xi = required(&part("mirror_parameters")?, "xi")?;
            FileLens { piece: "unified", values: [&[xi], &k[..4]].concat() }
        }
        other => return Err(node.unsupported(other, "PINHOLE, PINHOLE_FULL, KANNALA_BRANDT and MEI")),
    };
    Ok(Intrinsics { size: node.size()?, pinhole: projection.named_pinhole()?, lens: Some(lens) })
}

pub(super) fn write(camera: &ExportCamera) -> Export {
    let mut written = nearest(&camera.camera, FORMAT, &HELD);
    let k = &written.values;
    let section = |name: &str, names: &[&str], values: &[f64]| -> String {
        let fields = names.iter().zip(values).map(|(name, value)| format!("   {name}: {}\n", number(*value)));
        format!("{name}:\n{}", fields.collect::<String>())
    };
    let (pinhole, decentred) = (["fx", "fy", "cx", "cy"], ["k1", "k2", "p1", "p2"]);
    let sections = match written.lens {
        FISHEYE => {
            let values = [&k[..], &written.pinhole].concat();
            section(PROJECTION, &["k2", "k3", "k4", "k5", "mu", "mv", "u0", "v0"], &values)
        }
        MEI => {
            section("mirror_parameters", &["xi"], &k[..1])
                + &section(DISTORTION, &decentred, &k[1..])
                + &section(PROJECTION, &["gamma1", "gamma2", "u0", "v0"], &written.pinhole)
        }
        _ => {
            let names = ["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"];
            section(DISTORTION, &names[..k.len()], k) + &section(PROJECTION, &pinhole, &written.pinhole)
        }
    };
    let text = format!(
        "%YAML:1.0\n---\nmodel_type: {}\ncamera_name: depthcal\nimage_width: {}\nimage_height: {}\n{sections}",
        written.lens.name, camera.camera.width, camera.camera.height
    );
    written.warnings.extend(camera.depth_loss(FORMAT));
    Export { text, warnings: written.warnings }
}
