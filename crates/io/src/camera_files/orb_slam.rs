//! ORB-SLAM's settings: the camera alone.
//!
//! | key | contents |
//! |---|---|
//! | `Camera.type` | `PinHole`, `KannalaBrandt8`, or `Rectified` without a lens; ORB-SLAM 2 has none and means `PinHole` |
//! | `Camera1.fx`, `.fy`, `.cx`, `.cy` | px (`Camera.fx` before `File.version` 1.0); `Camera2` of a stereo camera |
//! | `Camera1.k1` … | k1 k2 p1 p2 k3 of a pinhole, k1 … k4 of `KannalaBrandt8` |
//! | `Camera.width`, `Camera.height` | px |
//!
//! Source: ORB-SLAM 3's Settings.cc, `readCamera1`. The settings of the tracker are the user's to add.

use super::capability::{HeldLens, nearest};
use super::error::CameraFileError;
use super::export_camera::ExportCamera;
use super::intrinsics::Intrinsics;
use super::lens_words::{LensModel, from_terms};
use super::node::Node;
use super::outcome::Export;
use super::text::number;

const FORMAT: &str = "ORB-SLAM 3";
const FISHEYE: HeldLens = HeldLens { name: "KannalaBrandt8", piece: "kannala_brandt", count: 4 };
const HELD: [HeldLens; 2] = [HeldLens { name: "PinHole", piece: "brown_conrady", count: 5 }, FISHEYE];

/// Names of the cameras of a document.
pub(super) fn cameras(node: &Node<'_>) -> Vec<String> {
    // One camera alone, without ORB-SLAM's settings, may be anybody's mapping.
    let is_settings = |name: &str| node.node(name).is_some_and(|camera| camera.has("type") || camera.has("fps"));
    let is_camera = |name: &&str| node.node(name).is_some_and(|camera| camera.has("fx") && camera.has("cx"));
    if !is_settings("Camera") {
        return Vec::new();
    }
    ["Camera", "Camera1", "Camera2"].into_iter().filter(is_camera).map(str::to_owned).collect()
}

pub(super) fn read(node: &Node<'_>, name: &str) -> Result<Intrinsics, CameraFileError> {
    let missing = |field: &str| node.fault(field, "is missing");
    let camera = node.node(name).ok_or_else(|| missing(name))?;
    let settings = node.node("Camera").ok_or_else(|| missing("Camera"))?;
    let lens = match settings.text("type").unwrap_or("PinHole") {
        // ORB-SLAM takes k1 k2 p1 p2 for zero where they are not there.
        "PinHole" | "Pinhole" => from_terms(&camera, Some(LensModel::BrownConrady))?,
        "KannalaBrandt8" => {
            let lens = from_terms(&camera, Some(LensModel::Fisheye))?;
            Some(lens.ok_or_else(|| camera.without_lens("fx"))?)
        }
        "Rectified" => None,
        other => return Err(settings.unsupported(other, "PinHole, KannalaBrandt8 and Rectified")),
    };
    Ok(Intrinsics { size: settings.size()?, pinhole: camera.named_pinhole()?, lens })
}

pub(super) fn write(camera: &ExportCamera) -> Export {
    let mut written = nearest(&camera.camera, FORMAT, &HELD);
    let names: &[&str] =
        if written.lens == FISHEYE { &["k1", "k2", "k3", "k4"] } else { &["k1", "k2", "p1", "p2", "k3"] };
    let pinhole = ["fx", "fy", "cx", "cy"].into_iter().zip(written.pinhole);
    let lens = names.iter().copied().zip(written.values.iter().copied());
    let fields: String = pinhole.chain(lens).map(|(name, v)| format!("Camera1.{name}: {}\n", number(v))).collect();
    let text = format!(
        "%YAML:1.0\n---\nFile.version: \"1.0\"\nCamera.type: \"{}\"\n{fields}Camera.width: {}\nCamera.height: {}\n",
        written.lens.name, camera.camera.width, camera.camera.height
    );
    written.warnings.extend(camera.depth_loss(FORMAT));
    Export { text, warnings: written.warnings }
}
