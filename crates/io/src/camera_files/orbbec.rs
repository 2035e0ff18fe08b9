//! Orbbec's camera parameters as the SDK's `OBCameraParam` names them, in JSON.
//!
//! | key | contents |
//! |---|---|
//! | `depthIntrinsic`, `rgbIntrinsic` (`depth_intrinsic`, …) | fx fy cx cy, width, height, px; pixel centres at integers |
//! | `depthDistortion`, `rgbDistortion` | k1 … k6 p1 p2, OpenCV's eight by name; `model` where the SDK has one |
//!
//! Source: `OBCameraIntrinsic`, `OBCameraDistortion` in ObTypes.h. A mapping with `…intrinsic` and `…distortion` is read so.

use super::error::CameraFileError;
use super::intrinsics::Intrinsics;
use super::keys::plain;
use super::modified_lens;
use super::named;
use super::node::Node;

/// The words before `intrinsic`, in plain letters.
fn camera_of(key: &str) -> Option<String> {
    let plain = plain(key);
    let camera = plain.strip_suffix("intrinsics").or(plain.strip_suffix("intrinsic"));
    camera.map(str::to_owned)
}

/// The key of a camera's distortion.
fn distortion_of<'a>(node: &Node<'a>, camera: &str) -> Option<&'a str> {
    let names = [format!("{camera}distortion"), format!("{camera}distortions")];
    node.keys().into_iter().find(|key| names.contains(&plain(key)) && node.node(key).is_some())
}

/// Keys of the intrinsics, in a mapping that has a distortion too.
pub(super) fn cameras(node: &Node<'_>) -> Vec<String> {
    let is_camera = |key: &&str| {
        let is_pinhole = node.node(key).is_some_and(|inner| !named::cameras(&inner).is_empty());
        is_pinhole && camera_of(key).is_some_and(|camera| distortion_of(node, &camera).is_some())
    };
    node.keys().into_iter().filter(is_camera).map(str::to_owned).collect()
}

pub(super) fn read(node: &Node<'_>, name: &str) -> Result<Intrinsics, CameraFileError> {
    let missing = |field: &str| node.fault(field, "is missing");
    let pinhole = node.node(name).ok_or_else(|| missing(name))?;
    let distortion = camera_of(name).and_then(|camera| distortion_of(node, &camera));
    let lens = distortion.and_then(|key| node.node(key)).ok_or_else(|| missing("distortion"))?;
    let camera =
        Intrinsics { size: pinhole.size()?, pinhole: pinhole.named_pinhole()?, lens: named::lens(&lens, &lens)? };
    modified_lens::check(&lens, &camera)?;
    Ok(camera)
}
