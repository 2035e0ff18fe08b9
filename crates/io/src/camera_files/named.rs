//! Cameras whose numbers have names of their own: fx, fy, cx, cy, and k1, k2, p1, p2, k3 …, or a list of coefficients.

use super::error::CameraFileError;
use super::intrinsics::{FileLens, Intrinsics};
use super::keys;
use super::lens_words::{LensModel, from_list, from_terms, model_of};
use super::modified_lens;
use super::node::Node;

/// The only camera of a mapping with focal lengths and a principal point.
pub(super) fn cameras(node: &Node<'_>) -> Vec<String> {
    let is_one = [keys::FX, keys::FY, keys::CX, keys::CY].iter().all(|table| node.key(table).is_some());
    if is_one { vec![String::new()] } else { Vec::new() }
}

pub(super) fn read(node: &Node<'_>, _: &str) -> Result<Intrinsics, CameraFileError> {
    let camera = Intrinsics { size: node.size()?, pinhole: node.named_pinhole()?, lens: lens(node, node)? };
    modified_lens::check(node, &camera)?;
    Ok(camera)
}

/// The lens that stands in a mapping, in its list or mapping of coefficients; `camera` has the focal lengths, for errors.
pub(super) fn lens(node: &Node<'_>, camera: &Node<'_>) -> Result<Option<FileLens>, CameraFileError> {
    let model = model_of(node)?;
    let field = node.key(keys::COEFFICIENTS);
    if let Some(field) = field.filter(|field| node.is_list(field)) {
        return from_list(node, field, model);
    }
    let inner = field.and_then(|field| node.node(field));
    let inner = inner.as_ref().unwrap_or(node);
    match from_terms(inner, model_of(inner)?.or(model))? {
        None if model != Some(LensModel::Undistorted) => Err(camera.without_lens(camera.key(keys::FX).unwrap_or("fx"))),
        lens => Ok(lens),
    }
}
