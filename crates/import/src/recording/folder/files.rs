//! Streams of files, and what the readers of all folders share.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use depthcal_io::{decode_gray, read_depth_frame};

use crate::camera_info::CameraInfo;
use crate::error::ImportError;
use crate::recording::StreamInfo;

/// Kinds of the streams of a folder.
pub(crate) const IMAGE_FILES: &str = "image files";
pub(crate) const DEPTH_FILES: &str = "depth files";

/// How a depth file is stored.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Stored {
    /// A file of its own format.
    File,
    /// Floating-point numbers of an image of this width and height, compressed by Apple's LZFSE.
    Lzfse([usize; 2]),
}

/// A file of a stream.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct FileFrame {
    pub time_ns: u64,
    pub path: PathBuf,
    /// Of depth, a file with a value for every pixel that is 0 where the measurement is not to be trusted.
    pub confidence: Option<PathBuf>,
}

/// A stream of files.
#[derive(Debug)]
pub(super) struct FileStream {
    pub info: StreamInfo,
    pub stored: Stored,
    /// Millimetres per step or unit of depth.
    pub unit_mm: Option<f64>,
    pub camera: Option<CameraInfo>,
    pub frames: Vec<FileFrame>,
}

/// A fault of a folder, with its remedy.
pub(super) fn fault(path: &Path, problem: impl Into<String>) -> ImportError {
    ImportError::Folder { path: path.to_owned(), problem: problem.into() }
}

pub(super) fn text_of(path: &Path) -> Result<String, ImportError> {
    fs::read_to_string(path).map_err(|error| ImportError::Read { path: path.to_owned(), error })
}

/// A number without a sign, as a time in ns.
pub(super) fn nanoseconds(seconds: f64) -> Option<u64> {
    (0.0..1e10).contains(&seconds).then(|| (seconds * 1e9).round() as u64)
}

/// Files of a folder whose names are numbers, by these; with one of the extensions.
pub(super) fn numbered_files(folder: &Path, extensions: &[&str]) -> Result<Vec<(u64, PathBuf)>, ImportError> {
    let unreadable = |error| ImportError::Read { path: folder.to_owned(), error };
    let entries = fs::read_dir(folder).and_then(Iterator::collect::<io::Result<Vec<_>>>).map_err(unreadable)?;
    let mut files: Vec<(u64, PathBuf)> = entries
        .iter()
        .map(fs::DirEntry::path)
        .filter(|path| path.extension().is_some_and(|e| extensions.iter().any(|known| e.eq_ignore_ascii_case(known))))
        .filter_map(|path| Some((path.file_stem()?.to_str()?.parse().ok()?, path)))
        .collect();
    files.sort();
    Ok(files)
}

/// Extensions of images that are kept as they are.
pub(super) const IMAGES: [&str; 3] = ["png", "jpg", "jpeg"];

/// Width and height of an image file.
pub(super) fn image_size(path: &Path) -> Result<[usize; 2], ImportError> {
    let bytes = fs::read(path).map_err(|error| ImportError::Read { path: path.to_owned(), error })?;
    let image = decode_gray(path, &bytes)?;
    Ok([image.width, image.height])
}

pub(super) fn depth_size(path: &Path) -> Result<[usize; 2], ImportError> {
    let depth = read_depth_frame(path)?;
    Ok([depth.width, depth.height])
}

/// Intrinsics of an image of `size` for another size of the same view, pixel centres at integers.
pub(super) fn scaled(camera: &CameraInfo, [width, height]: [usize; 2]) -> CameraInfo {
    let [sx, sy] = [width as f64 / camera.width as f64, height as f64 / camera.height as f64];
    let [fx, fy, cx, cy] = camera.pinhole;
    let centre = |c: f64, s: f64| (c + 0.5) * s - 0.5;
    CameraInfo { width, height, pinhole: [fx * sx, fy * sy, centre(cx, sx), centre(cy, sy)], ..camera.clone() }
}

/// Intrinsics without a lens, if they can be those of an image of `size`.
pub(super) fn pinhole(size: [usize; 2], numbers: [f64; 4]) -> Option<CameraInfo> {
    let [width, height] = size;
    let (model, distortion) = (String::new(), Vec::new());
    let camera = CameraInfo { width, height, model, distortion, pinhole: numbers };
    let is_central = |c: f64, side: usize| (0.2..=0.8).contains(&(c / side as f64));
    let [_, _, cx, cy] = numbers;
    (camera.is_plausible() && is_central(cx, width) && is_central(cy, height)).then_some(camera)
}
