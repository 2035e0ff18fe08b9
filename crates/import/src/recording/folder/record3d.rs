//! The exports of Record3D, which records a phone's depth: the contents of an `.r3d` file, and the export "EXR + RGB".

use std::fs;
use std::path::Path;

use serde_json::Value;

use super::files::{
    DEPTH_FILES, FileFrame, FileStream, IMAGE_FILES, IMAGES, Stored, depth_size, fault, image_size, nanoseconds,
    numbered_files, pinhole, scaled, text_of,
};
use super::lzfse::{Lzfse, MOST_PIXELS};
use crate::camera_info::CameraInfo;
use crate::error::ImportError;
use crate::recording::StreamInfo;

/// Frames per second where the export does not say.
const USUAL_FPS: f64 = 30.0;

/// The streams of a folder; `None` where it is no export of Record3D.
pub(super) fn open(folder: &Path) -> Result<Option<Vec<FileStream>>, ImportError> {
    // The export "EXR + RGB" has a folder within.
    let inner = folder.join("EXR_RGBD");
    let folder = if inner.is_dir() { inner.as_path() } else { folder };
    let rgbd = folder.join("rgbd");
    let is_export = folder.join("rgb").is_dir() && folder.join("depth").is_dir();
    let metadata = [folder.join("metadata"), folder.join("metadata.json")].into_iter().find(|path| path.is_file());
    let Some(metadata) = metadata.filter(|_| rgbd.is_dir() || is_export) else { return Ok(None) };
    let values: Value = serde_json::from_str(&text_of(&metadata)?)
        .map_err(|error| fault(&metadata, format!("it is not JSON ({error}): export it anew")))?;
    let (images, depths) = match rgbd.is_dir() {
        true => (numbered_files(&rgbd, &IMAGES)?, numbered_files(&rgbd, &["depth"])?),
        false => (
            numbered_files(&folder.join("rgb"), &IMAGES)?,
            numbered_files(&folder.join("depth"), &["exr", "tiff", "png"])?,
        ),
    };
    let (Some((_, image)), Some((_, depth))) = (images.first(), depths.first()) else {
        return Err(fault(folder, "there are no images or no depth, named by the numbers of frames: export it anew"));
    };
    let of_image = image_size(image)?;
    let (stored, of_depth) = match depth.extension().is_some_and(|e| e == "depth") {
        true => {
            let size = declared_size(&values).map_or_else(|| size_by_aspect(depth, of_image), Ok)?;
            (Stored::Lzfse(size), size)
        }
        false => (Stored::File, depth_size(depth)?),
    };
    let camera = intrinsics(&metadata, &values, of_image);
    let of_depth = camera.as_ref().map(|camera| scaled(camera, of_depth));
    let times: Vec<f64> =
        values["frameTimestamps"].as_array().into_iter().flatten().filter_map(Value::as_f64).collect();
    let fps = values["fps"].as_f64().filter(|fps| *fps > 0.0).unwrap_or(USUAL_FPS);
    let frames = |files: Vec<(u64, std::path::PathBuf)>| -> Vec<FileFrame> {
        let frame = |(number, path): (u64, std::path::PathBuf)| {
            let seconds = times.get(number as usize).copied().unwrap_or(number as f64 / fps);
            let confidence = Some(path.with_extension("conf")).filter(|path| path.is_file());
            FileFrame { time_ns: nanoseconds(seconds).unwrap_or(0), path, confidence }
        };
        files.into_iter().map(frame).collect()
    };
    let stream = |name: &str, kind: &str, unit_mm, camera, files| FileStream {
        info: StreamInfo { name: name.to_owned(), kind: kind.to_owned() },
        stored,
        unit_mm,
        camera,
        frames: frames(files),
    };
    Ok(Some(vec![
        stream("rgb", IMAGE_FILES, None, camera, images),
        stream("depth", DEPTH_FILES, Some(1000.0), of_depth, depths),
    ]))
}

/// Width and height of depth, as newer versions say.
fn declared_size(metadata: &Value) -> Option<[usize; 2]> {
    let side =
        |name: &str| metadata[name].as_u64().map(|side| side as usize).filter(|side| (1..=10_000).contains(side));
    Some([side("dw")?, side("dh")?])
}

/// Width and height of depth that has the image's sides' ratio.
fn size_by_aspect(depth: &Path, [width, height]: [usize; 2]) -> Result<[usize; 2], ImportError> {
    let bytes = fs::read(depth).map_err(|error| ImportError::Read { path: depth.to_owned(), error })?;
    let count = Lzfse { path: depth, bytes: &bytes }.unpacked(4 * MOST_PIXELS)?.len() / 4;
    let across = (count as f64 * width as f64 / height as f64).sqrt().round().max(1.0) as usize;
    match count > 0 && count % across == 0 {
        true => Ok([across, count / across]),
        false => Err(fault(
            depth,
            format!("{count} values are no image with the sides' ratio of {width}×{height}: export it anew"),
        )),
    }
}

/// K, by columns as the app writes it, or by rows.
fn intrinsics(path: &Path, metadata: &Value, size: [usize; 2]) -> Option<CameraInfo> {
    let k: Vec<f64> = metadata["K"].as_array().into_iter().flatten().filter_map(Value::as_f64).collect();
    let camera = match k[..] {
        [fx, _, 0.0, _, fy, 0.0, cx, cy, _] => pinhole(size, [fx, fy, cx, cy]),
        [fx, _, cx, _, fy, cy, ..] => pinhole(size, [fx, fy, cx, cy]),
        _ => None,
    };
    if camera.is_none() {
        let [width, height] = size;
        tracing::warn!(
            "{}: K is left out of the start values: it is not of images of {width} × {height} px",
            path.display()
        );
    }
    camera
}
