//! A dataset: a folder of captures with its frames.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use depthcal_model::Target;

use super::camera_hint::CameraHint;
use super::declaration::{DATASET_FILE, DatasetFile, FramesSection};
use super::error::DatasetError;
use super::frame_table::{self, FrameMetadata};
use super::natural;
use crate::file::{FileError, digest_files};

/// A folder of captures of a board, described by its `dataset.toml`.
#[derive(Debug, Clone, PartialEq)]
pub struct Dataset {
    /// The folder.
    pub root: PathBuf,
    /// The folder's name.
    pub name: String,
    /// The board; the diameter of its dots is 0 where `dataset.toml` does not declare it.
    pub target: Target,
    /// The frames in natural order of their names.
    pub frames: Vec<Frame>,
    /// Millimetres per step of the depth images; `None` where there is no depth.
    pub depth_unit_mm: Option<f64>,
    /// Declared intrinsics.
    pub camera: Option<CameraHint>,
    /// The table of frames, where one is declared.
    pub metadata: Option<PathBuf>,
}

/// One capture.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// The stem of its files.
    pub name: String,
    /// The image; `None` where the dataset declares none.
    pub image: Option<PathBuf>,
    /// The depth image; `None` where the dataset declares none.
    pub depth: Option<PathBuf>,
    /// Its row in the table of frames.
    pub metadata: FrameMetadata,
}

impl Dataset {
    /// Opens the dataset in the folder `path`, or the one whose `dataset.toml` is `path`. Image files are listed, not
    /// read.
    ///
    /// # Errors
    /// [`DatasetError`] with the file, the field and the remedy.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, DatasetError> {
        let path = path.as_ref();
        let root = match path.parent() {
            Some(parent) if path.ends_with(DATASET_FILE) && !path.is_dir() => {
                if parent.as_os_str().is_empty() {
                    Path::new(".")
                } else {
                    parent
                }
            }
            _ => path,
        };
        let file_path = root.join(DATASET_FILE);
        let file = DatasetFile::read(&file_path)?;

        let mut frames = find_frames(root, &file_path, &file.frames)?;
        let metadata = file.frames.metadata.as_ref().map(|name| root.join(name));
        if let Some(table) = &metadata {
            assign_metadata(table, &mut frames)?;
        }
        Ok(Dataset {
            name: folder_name(root),
            root: root.to_owned(),
            target: file.board,
            frames,
            depth_unit_mm: file.depth.map(|depth| depth.unit_mm),
            camera: file.camera,
            metadata,
        })
    }

    /// The frame called `name`.
    pub fn frame(&self, name: &str) -> Option<&Frame> {
        self.frames.iter().find(|frame| frame.name == name)
    }

    /// Digest of `dataset.toml`, the table of frames and all images and depth images; see [`digest_files`].
    ///
    /// # Errors
    /// [`FileError::Read`] names the file that cannot be read.
    pub fn digest(&self) -> Result<String, FileError> {
        let mut files = vec![self.root.join(DATASET_FILE)];
        files.extend(self.metadata.clone());
        files.extend(self.frames.iter().flat_map(|frame| frame.image.iter().chain(&frame.depth).cloned()));
        digest_files(&self.root, &files)
    }
}

/// Name of the folder, even when the path is `.` or ends with `..`.
fn folder_name(root: &Path) -> String {
    let name = |path: &Path| path.file_name().map(|name| name.to_string_lossy().into_owned());
    name(root).or_else(|| name(&root.canonicalize().ok()?)).unwrap_or_else(|| "dataset".into())
}

fn find_frames(root: &Path, file: &Path, section: &FramesSection) -> Result<Vec<Frame>, DatasetError> {
    let find = |field, pattern: &Option<String>| {
        pattern.as_ref().map(|pattern| find_files(root, file, field, pattern)).transpose()
    };
    let images = find("frames.image", &section.image)?;
    let depth = find("frames.depth", &section.depth)?;
    if let (Some(images), Some(depth)) = (&images, &depth) {
        let without = |one: &BTreeMap<String, PathBuf>, other: &BTreeMap<String, PathBuf>| {
            let mut names: Vec<_> = one.keys().filter(|stem| !other.contains_key(*stem)).cloned().collect();
            names.sort_by(|a, b| natural::compare(a, b));
            names
        };
        let (images_without_depth, depth_without_image) = (without(images, depth), without(depth, images));
        if !images_without_depth.is_empty() || !depth_without_image.is_empty() {
            return Err(DatasetError::Unpaired { path: file.to_owned(), images_without_depth, depth_without_image });
        }
    }

    let stems = images.as_ref().or(depth.as_ref()).map(|files| files.keys().cloned().collect::<Vec<_>>());
    let file_of = |files: &Option<BTreeMap<String, PathBuf>>, stem: &str| files.as_ref()?.get(stem).cloned();
    let mut frames: Vec<_> = stems
        .unwrap_or_default()
        .into_iter()
        .map(|name| Frame {
            image: file_of(&images, &name),
            depth: file_of(&depth, &name),
            metadata: FrameMetadata::default(),
            name,
        })
        .collect();
    frames.sort_by(|a, b| natural::compare(&a.name, &b.name));
    Ok(frames)
}

/// Files that match the glob, by stem.
fn find_files(
    root: &Path,
    file: &Path,
    field: &'static str,
    pattern: &str,
) -> Result<BTreeMap<String, PathBuf>, DatasetError> {
    let glob_error =
        |message| DatasetError::Glob { path: file.to_owned(), field, pattern: pattern.to_owned(), message };
    let Some(folder) = root.to_str() else {
        return Err(glob_error("the folder's own name is not UTF-8, which no glob can match; rename it".into()));
    };
    let full = if Path::new(pattern).is_absolute() {
        pattern.to_owned()
    } else {
        format!("{}/{pattern}", glob::Pattern::escape(folder))
    };
    // Hidden files are temporary or the operating system's; `*` must not match a `/`.
    let options =
        glob::MatchOptions { case_sensitive: true, require_literal_separator: true, require_literal_leading_dot: true };
    let paths = glob::glob_with(&full, options).map_err(|error| glob_error(error.to_string()))?;

    let mut files = BTreeMap::new();
    for path in paths {
        let path = path.map_err(|error| DatasetError::Read { path: error.path().to_owned(), error: error.into() })?;
        if !path.is_file() {
            continue;
        }
        let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
        if let Some(first) = files.insert(stem, path.clone()) {
            return Err(DatasetError::DuplicateStem { path: file.to_owned(), field, first, second: path });
        }
    }
    if files.is_empty() {
        return Err(DatasetError::NoMatch { path: file.to_owned(), field, pattern: pattern.to_owned() });
    }
    Ok(files)
}

fn assign_metadata(table: &Path, frames: &mut [Frame]) -> Result<(), DatasetError> {
    let rows = frame_table::read(table)?;
    let names: BTreeMap<_, _> = frames.iter().enumerate().map(|(i, frame)| (frame.name.clone(), i)).collect();
    // Some tables give the file's name instead of its stem.
    let index_of = |row: &frame_table::Row| {
        names.get(&row.frame).or_else(|| names.get(Path::new(&row.frame).file_stem()?.to_str()?)).copied()
    };
    let mut has_row = vec![false; frames.len()];
    let mut rows_without_frame = Vec::new();
    for row in rows {
        match index_of(&row) {
            Some(i) => {
                has_row[i] = true;
                frames[i].metadata = row.metadata;
            }
            None => rows_without_frame.push(row.frame),
        }
    }
    let frames_without_row: Vec<_> =
        frames.iter().zip(&has_row).filter(|(_, has_row)| !**has_row).map(|(frame, _)| frame.name.clone()).collect();
    if rows_without_frame.is_empty() && frames_without_row.is_empty() {
        Ok(())
    } else {
        Err(DatasetError::Rows { path: table.to_owned(), rows_without_frame, frames_without_row })
    }
}

#[cfg(test)]
mod tests;
