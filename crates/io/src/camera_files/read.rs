//! Reading a camera from any of the formats.

use std::path::{Path, PathBuf};

use super::error::CameraFileError;
use super::intrinsics::Intrinsics;
use super::node::Node;
use super::{colmap, document, keys, programs};
use crate::file::StandIn;

/// Reads a camera from a file of another program, whose format is recognised by its contents. Of several cameras one is named
/// after the path: `camchain.yaml#cam1`.
///
/// # Errors
/// [`CameraFileError`].
pub fn read_camera(path: impl AsRef<Path>) -> Result<Intrinsics, CameraFileError> {
    read_camera_file(path.as_ref())
}

fn read_camera_file(given: &Path) -> Result<Intrinsics, CameraFileError> {
    let (path, name) = match given.to_str().and_then(|text| text.rsplit_once('#')) {
        Some((path, name)) if !given.exists() => (PathBuf::from(path), Some(name)),
        _ => (given.to_owned(), None),
    };
    let unreadable = |e: std::io::Error| CameraFileError::Read { path: path.clone(), reason: e.to_string() };
    let text = String::from_utf8(std::fs::read(&path).map_err(unreadable)?);
    let text = text.map_err(|e| CameraFileError::Binary { path: path.clone(), remedy: text_of(e.as_bytes()) })?;
    parse_camera(&path, &text, name)
}

/// The remedy for a file that is no text.
fn text_of(bytes: &[u8]) -> &'static str {
    if bytes.starts_with(b"PK") || bytes.starts_with(b"\x93NUMPY") {
        "write matrix and coefficients of NumPy's file with cv2.FileStorage"
    } else {
        "give COLMAP's cameras.txt for cameras.bin (colmap model_converter --output_type TXT), and YAML, XML or JSON for other files"
    }
}

/// Reads a camera from the text of such a file; `path` only names its source in errors, `name` one of several cameras.
///
/// # Errors
/// [`CameraFileError`].
pub fn parse_camera(path: &Path, text: &str, name: Option<&str>) -> Result<Intrinsics, CameraFileError> {
    // Azure Kinect's factory calibration ends with a zero.
    let text = text.strip_prefix('\u{feff}').unwrap_or(text).trim_end_matches('\0').trim_start_matches(['\r', '\n']);
    if let Some(stand_in) = StandIn::of(text.as_bytes()) {
        return Err(CameraFileError::Read { path: path.to_owned(), reason: stand_in.to_string() });
    }
    if colmap::is_one(text) {
        let cameras = colmap::cameras(text);
        let ids = cameras.iter().map(|(id, _)| (*id).to_owned()).collect();
        let (id, words) = &cameras[chosen(path, ids, name)?];
        return colmap::read(path, id, words);
    }
    let document = document::parse(path, text)?;
    let node = Node::document(path, &document);
    let cameras = programs::cameras(&node);
    if cameras.is_empty() {
        return Err(CameraFileError::UnknownFormat {
            path: path.to_owned(),
            keys: node.owned_keys(),
            hint: hint(&node),
        });
    }
    cameras[chosen(path, cameras.iter().map(|camera| camera.name.clone()).collect(), name)?].read()
}

/// The remedy for a document of a program that is not read.
fn hint(node: &Node<'_>) -> &'static str {
    if node.text("format").is_some_and(|format| format.starts_with("depthcal")) {
        "it is depthcal's own: `depthcal export` writes a camera file of a calibration"
    } else if node.has("camera_angle_x") {
        "transforms without fl_x do not say the image's size: write w, h, fl_x, fl_y, cx and cy"
    } else if node.key(keys::COEFFICIENTS).is_some() {
        "there is a lens, but no camera matrix: write it as `camera_matrix`, row by row"
    } else {
        "write `camera_matrix` (row by row) and `distortion_coefficients` as OpenCV does; docs/lenses.md lists what is read"
    }
}

/// Place of the camera that is named, by the whole name or its last part, or of the only one.
fn chosen(path: &Path, cameras: Vec<String>, name: Option<&str>) -> Result<usize, CameraFileError> {
    let path = path.to_owned();
    let Some(name) = name else {
        return if cameras.len() == 1 { Ok(0) } else { Err(CameraFileError::SeveralCameras { path, cameras }) };
    };
    let last = |camera: &String| camera.rsplit_once('.').is_some_and(|(_, last)| last == name);
    let whole = cameras.iter().position(|camera| camera == name);
    let by_last = || cameras.iter().position(last).filter(|i| !cameras[i + 1..].iter().any(last));
    whole.or_else(by_last).ok_or_else(|| CameraFileError::NoSuchCamera { path, name: name.to_owned(), cameras })
}
