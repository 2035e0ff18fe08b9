//! Reading a camera from any of the formats.

use std::path::{Path, PathBuf};

use super::error::CameraFileError;
use super::intrinsics::Intrinsics;
use super::yaml::{Node, parse};
use super::{colmap, kalibr, mrcal, opencv, ros};

/// Reads a camera from a file of another program, whose format is recognised by its contents. Of several cameras one is named
/// after the path: `camchain.yaml#cam1`.
///
/// # Errors
/// [`CameraFileError`].
pub fn read_camera(path: impl AsRef<Path>) -> Result<Intrinsics, CameraFileError> {
    let given = path.as_ref();
    let (path, name) = match given.to_str().and_then(|text| text.rsplit_once('#')) {
        Some((path, name)) if !given.exists() => (PathBuf::from(path), Some(name)),
        _ => (given.to_owned(), None),
    };
    let unreadable = |e: std::io::Error| CameraFileError::Read { path: path.clone(), reason: e.to_string() };
    parse_camera(&path, &std::fs::read_to_string(&path).map_err(unreadable)?, name)
}

/// Reads a camera from the text of such a file; `path` only names its source in errors, `name` one of several cameras.
///
/// # Errors
/// [`CameraFileError`].
pub fn parse_camera(path: &Path, text: &str, name: Option<&str>) -> Result<Intrinsics, CameraFileError> {
    if colmap::is_one(text) {
        let cameras = colmap::cameras(text);
        let ids: Vec<&str> = cameras.iter().map(|(id, _)| *id).collect();
        let (id, words) = &cameras[chosen(path, &ids, name)?];
        return colmap::read(path, id, words);
    }
    let document = parse(path, &mrcal::without_binary(text))?;
    let node = Node::document(path, &document);
    let chain = kalibr::cameras(&node);
    if !chain.is_empty() {
        let camera = node.node(chain[chosen(path, &chain, name)?]);
        return kalibr::read(&camera.unwrap_or(node));
    }
    if mrcal::is_one(&node) {
        mrcal::read(&node)
    } else if ros::is_one(&node) {
        ros::read(&node)
    } else if opencv::is_one(&node) {
        opencv::read(&node)
    } else {
        Err(CameraFileError::UnknownFormat { path: path.to_owned() })
    }
}

/// Place of the camera that is named, or of the only one.
fn chosen(path: &Path, cameras: &[&str], name: Option<&str>) -> Result<usize, CameraFileError> {
    let (path, names) = (path.to_owned(), cameras.iter().map(|c| (*c).to_owned()).collect());
    match name {
        Some(name) => cameras.iter().position(|c| *c == name).ok_or(CameraFileError::NoSuchCamera {
            path,
            name: name.to_owned(),
            cameras: names,
        }),
        None if cameras.len() == 1 => Ok(0),
        None => Err(CameraFileError::SeveralCameras { path, cameras: names }),
    }
}
