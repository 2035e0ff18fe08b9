//! Cameras of a camera matrix and distortion coefficients: OpenCV's FileStorage, ROS camera_info and messages, `ost.ini`, and
//! the files that scripts make of `calibrateCamera`'s results.
//!
//! Keys are those of [`keys::MATRIX`] and [`keys::COEFFICIENTS`] in any spelling; a file of several cameras has their names in
//! its keys (`M1`, `D1`, `M2`, `D2`). The lens model is named (`distortion_model`, `fisheye_model`) or follows from the number of
//! coefficients, as in OpenCV.

use super::error::CameraFileError;
use super::intrinsics::{FileLens, Intrinsics};
use super::keys::{self, camera_in};
use super::lens_words::{LensModel, from_list, from_terms, model_of};
use super::modified_lens;
use super::node::Node;

/// Keys of the camera matrices of a mapping, one for each camera.
fn matrices<'a>(node: &Node<'a>) -> Vec<(&'a str, String)> {
    let mut cameras: Vec<(&str, String)> = Vec::new();
    for key in node.keys() {
        let Some(camera) = camera_in(key, keys::MATRIX).filter(|_| node.is_list(key)) else { continue };
        if cameras.iter().all(|(_, known)| *known != camera) {
            cameras.push((key, camera));
        }
    }
    cameras
}

/// Names of the cameras of a mapping: the keys of their matrices; empty for the only one.
pub(super) fn cameras(node: &Node<'_>) -> Vec<String> {
    match &matrices(node)[..] {
        [(_, camera)] if camera.is_empty() => vec![String::new()],
        several => several.iter().map(|(key, _)| (*key).to_owned()).collect(),
    }
}

/// Reads the camera whose matrix has the key `name`, or the only one.
pub(super) fn read(node: &Node<'_>, name: &str) -> Result<Intrinsics, CameraFileError> {
    let all = matrices(node);
    let chosen = all.iter().find(|(key, _)| *key == name).or(all.first());
    let Some((_, camera)) = chosen else { return Err(node.fault("camera_matrix", "is missing")) };
    let field = one_of(node, keys::MATRIX, camera)?.unwrap_or("camera_matrix");
    let pinhole = node.camera_matrix(field)?;
    let camera = Intrinsics { size: node.size()?, pinhole, lens: lens(node, camera, field)? };
    modified_lens::check(node, &camera)?;
    Ok(camera)
}

/// The lens of a camera of a mapping.
fn lens(node: &Node<'_>, camera: &str, matrix: &str) -> Result<Option<FileLens>, CameraFileError> {
    let model = model_of(node)?;
    if let Some(field) = one_of(node, keys::COEFFICIENTS, camera)? {
        let lens = from_list(node, field, model)?;
        let is_unnamed = node.key(keys::LENS_MODEL).and_then(|key| node.text(key)).is_some_and(str::is_empty);
        // ROS writes an empty model for a camera without a lens.
        if is_unnamed && lens.as_ref().is_some_and(|lens| lens.values.iter().any(|k| *k != 0.0)) {
            return Err(
                node.fault("distortion_model", "is empty: name the model of the coefficients, such as plumb_bob")
            );
        }
        return Ok(lens);
    }
    let named = node.key(keys::COEFFICIENTS).and_then(|key| node.node(key));
    let terms = if camera.is_empty() { from_terms(named.as_ref().unwrap_or(node), model)? } else { None };
    match (terms, model) {
        (None, Some(LensModel::Undistorted)) => Ok(None),
        (None, _) => Err(node.without_lens(matrix)),
        (lens, _) => Ok(lens),
    }
}

/// The list of a camera that a table names.
///
/// # Errors
/// Two spellings with different numbers.
fn one_of<'a>(node: &Node<'a>, table: &[&str], camera: &str) -> Result<Option<&'a str>, CameraFileError> {
    let is_one = |key: &&str| camera_in(key, table).as_deref() == Some(camera) && node.is_list(key);
    let keys: Vec<&str> = node.keys().into_iter().filter(is_one).collect();
    let Some((first, others)) = keys.split_first() else { return Ok(None) };
    for other in others {
        if node.numbers(first)? != node.numbers(other)? {
            return Err(node.fault(first, format!("and `{other}` are different: leave one of them out")));
        }
    }
    Ok(Some(first))
}
