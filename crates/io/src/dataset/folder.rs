//! A dataset: a folder of captures with its frames.

use std::io;
use std::path::{Path, PathBuf};

use depthcal_model::Target;

use super::camera_hint::CameraHint;
use super::declaration::{DATASET_FILE, DatasetFile, unit_missing};
use super::error::DatasetError;
use super::frames::{Frame, Frames, find_frames};
use super::inside::file_in;
use super::pairing::{Pairing, Stray};
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
    /// How images and depth were paired.
    pub pairing: Pairing,
    /// Files and rows that belong to no frame, in natural order.
    pub strays: Vec<Stray>,
    /// Tables and lists that say which files are frames.
    pub lists: Vec<PathBuf>,
}

impl Dataset {
    /// Opens the dataset in the folder `path`, or the one whose `dataset.toml` is `path`. Image files are listed, not
    /// read.
    ///
    /// # Errors
    /// [`DatasetError`] with the file, the field and the remedy.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, DatasetError> {
        let root = root_of(path.as_ref());
        let file_path = root.join(DATASET_FILE);
        let file = DatasetFile::read(&file_path)?;

        let Frames { frames, pairing, strays, lists } = find_frames(root, &file_path, &file.frames)?;
        if file.depth.is_none() && frames.iter().any(|frame| frame.depth.is_some()) {
            return Err(unit_missing(&file_path));
        }
        let dataset = Dataset {
            name: folder_name(root),
            root: root.to_owned(),
            target: file.board,
            frames,
            depth_unit_mm: file.depth.map(|depth| depth.unit_mm),
            camera: file.camera,
            metadata: file.frames.metadata.map(|name| file_in(root, &name)),
            pairing,
            strays,
            lists,
        };
        dataset.check_intrinsics()?;
        Ok(dataset)
    }

    /// Checks that the file of intrinsics, the one file that may lie outside of the folder, is no device and no pipe: these may
    /// have no end.
    pub(super) fn check_intrinsics(&self) -> Result<(), DatasetError> {
        match self.intrinsics_file() {
            Some(path) if path.exists() && !path.is_file() => {
                let error = io::Error::new(io::ErrorKind::InvalidInput, "camera.intrinsics has to name a regular file");
                Err(DatasetError::Read { path, error })
            }
            _ => Ok(()),
        }
    }

    /// The file of intrinsics that `[camera]` names, without the name of one of its cameras.
    pub fn intrinsics_file(&self) -> Option<PathBuf> {
        let given = self.camera.as_ref()?.intrinsics.as_deref()?;
        let path = self.root.join(given);
        let named = given.rsplit_once('#').filter(|_| !path.exists());
        Some(named.map_or(path, |(file, _)| self.root.join(file)))
    }

    /// The frame called `name`.
    pub fn frame(&self, name: &str) -> Option<&Frame> {
        self.frames.iter().find(|frame| frame.name == name)
    }

    /// Digest of `dataset.toml`, the tables and lists of frames and all images and depth images; see [`digest_files`].
    ///
    /// # Errors
    /// [`FileError::Read`] names the file that cannot be read.
    pub fn digest(&self) -> Result<String, FileError> {
        let mut files = vec![self.root.join(DATASET_FILE)];
        files.extend(self.lists.iter().cloned());
        files.extend(self.intrinsics_file());
        files.extend(self.frames.iter().flat_map(|frame| frame.image.iter().chain(&frame.depth).cloned()));
        digest_files(&self.root, &files)
    }
}

/// The folder that `path` is, or whose `dataset.toml` it is.
pub(crate) fn root_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if path.ends_with(DATASET_FILE) && !path.is_dir() => {
            if parent.as_os_str().is_empty() {
                Path::new(".")
            } else {
                parent
            }
        }
        _ => path,
    }
}

/// Name of the folder, even when the path is `.` or ends with `..`.
pub(crate) fn folder_name(root: &Path) -> String {
    let name = |path: &Path| path.file_name().map(|name| name.to_string_lossy().into_owned());
    name(root).or_else(|| name(&root.canonicalize().ok()?)).unwrap_or_else(|| "dataset".into())
}

#[cfg(test)]
mod tests;
