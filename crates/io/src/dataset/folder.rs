//! A dataset: a folder of captures with the frames of every camera.

use std::io;
use std::path::{Path, PathBuf};

use depthcal_model::{Target, Technology};

use super::camera_hint::CameraHint;
use super::declaration::{CAMERA, CameraSection, DATASET_FILE, DatasetFile};
use super::error::DatasetError;
use super::frame::{Frame, Frames};
use super::frames::find_frames;
use super::pairing::{Pairing, Stray};
use crate::file::{FileError, digest_files};
use crate::image::{DepthFrame, Disparity, ImageError, read_depth_frame};

/// A folder of captures of a board by one camera or several on one rigid body, described by its `dataset.toml`.
#[derive(Debug, Clone, PartialEq)]
pub struct Dataset {
    /// The folder.
    pub root: PathBuf,
    /// The folder's name.
    pub name: String,
    /// The board, or several; the diameter of dots is 0 where `dataset.toml` does not declare it.
    pub target: Target,
    /// The cameras, of which the first is the reference. Frames that were taken together have one name.
    pub cameras: Vec<DatasetCamera>,
}

/// The captures of one camera.
#[derive(Debug, Clone, PartialEq)]
pub struct DatasetCamera {
    /// The camera's name; [`CAMERA`](super::CAMERA) where the dataset names none.
    pub name: String,
    /// Name of its captures: that of the folder, of one camera of several with its own, `captures/colour`.
    pub title: String,
    /// The dataset's folder.
    pub root: PathBuf,
    /// The dataset's board.
    pub target: Target,
    /// The frames in natural order of their names. Those that this camera missed are not among them.
    pub frames: Vec<Frame>,
    /// Millimetres per step of the depth images; `None` where there is no depth, or disparities in its place.
    pub depth_unit_mm: Option<f64>,
    /// How the disparities that the depth images hold become depth; [`DatasetCamera::read_depth`] gives it in mm.
    pub disparity: Option<Disparity>,
    /// Declared intrinsics.
    pub camera: Option<CameraHint>,
    /// Known extrinsics, see [`CameraSection::camera_from_rig`].
    pub camera_from_rig: Option<[f64; 12]>,
    /// Expected extrinsics, see [`CameraSection::expected_from_rig`].
    pub expected_from_rig: Option<[f64; 12]>,
    /// How images and depth were paired.
    pub pairing: Pairing,
    /// Files and rows that belong to no frame, in natural order.
    pub strays: Vec<Stray>,
    /// Tables and lists that say which files are frames.
    pub lists: Vec<PathBuf>,
}

impl DatasetCamera {
    /// The principle by which the camera measures depth, where it is declared.
    pub fn technology(&self) -> Option<Technology> {
        self.camera.as_ref()?.technology
    }
}

impl Dataset {
    /// Opens the dataset in the folder `path`, or the one whose `dataset.toml` is `path`. Image files are listed, not
    /// read.
    ///
    /// # Errors
    /// [`DatasetError`] with the file, the field and the remedy.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, DatasetError> {
        Self::open_folder(path.as_ref())
    }

    fn open_folder(path: &Path) -> Result<Self, DatasetError> {
        let root = root_of(path);
        let file_path = root.join(DATASET_FILE);
        let file = DatasetFile::read(&file_path)?;
        let frames_by_camera = find_frames(root, &file_path, &file)?;
        let (name, is_one) = (folder_name(root), file.cameras.len() == 1);
        let mut cameras = Vec::new();
        for (declared, frames) in file.cameras.into_iter().zip(frames_by_camera) {
            if !declared.has_unit() && frames.frames.iter().any(|frame| frame.depth.is_some()) {
                return Err(declared.unit_missing(&file_path));
            }
            let title = if is_one { name.clone() } else { format!("{name}/{}", declared.name) };
            let camera = DatasetCamera::new(root, title, &file.board, declared, frames);
            camera.check_intrinsics()?;
            cameras.push(camera);
        }
        Ok(Self { root: root.to_owned(), name, target: file.board, cameras })
    }

    /// The camera of a dataset that has one.
    ///
    /// # Errors
    /// [`DatasetError::SeveralCameras`].
    pub fn into_only_camera(mut self) -> Result<DatasetCamera, DatasetError> {
        match (self.cameras.pop(), self.cameras.is_empty()) {
            (Some(camera), true) => Ok(camera),
            _ => Err(DatasetError::SeveralCameras { path: self.root.join(DATASET_FILE) }),
        }
    }
}

impl DatasetCamera {
    fn new(root: &Path, title: String, board: &Target, declared: CameraSection, frames: Frames) -> Self {
        let Frames { frames, pairing, strays, lists } = frames;
        Self {
            name: declared.name,
            title,
            root: root.to_owned(),
            target: board.clone(),
            frames,
            depth_unit_mm: declared.unit_mm,
            disparity: declared.disparity,
            camera: declared.camera,
            camera_from_rig: declared.camera_from_rig,
            expected_from_rig: declared.expected_from_rig,
            pairing,
            strays,
            lists,
        }
    }

    /// Whether the dataset gives it no name of its own.
    pub fn is_unnamed(&self) -> bool {
        self.name == CAMERA
    }

    /// Whether it has images.
    pub fn has_images(&self) -> bool {
        self.frames.iter().any(|frame| frame.image.is_some())
    }

    /// Reads one of its depth images: depth in [`DatasetCamera::depth_unit_mm`], or in mm where the file holds disparities.
    ///
    /// # Errors
    /// [`ImageError`] with the file, and of a unit that does not fit the type of its values.
    pub fn read_depth(&self, path: &Path) -> Result<DepthFrame, ImageError> {
        let frame = read_depth_frame(path)?;
        match &self.disparity {
            Some(disparity) => Ok(disparity.depth(&frame)),
            None => frame.check_unit(path, self.depth_unit_mm.unwrap_or(1.0)).map(|()| frame),
        }
    }

    /// Millimetres per unit of the depth that [`DatasetCamera::read_depth`] gives; `None` where nothing is declared.
    pub fn unit_mm(&self) -> Option<f64> {
        if self.disparity.is_some() { Some(1.0) } else { self.depth_unit_mm }
    }

    /// Whether it has depth images.
    pub fn has_depth(&self) -> bool {
        self.frames.iter().any(|frame| frame.depth.is_some())
    }

    /// Checks that the file of intrinsics, the one file that may lie outside of the folder, is no device and no pipe: these may
    /// have no end.
    fn check_intrinsics(&self) -> Result<(), DatasetError> {
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
fn root_of(path: &Path) -> &Path {
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
fn folder_name(root: &Path) -> String {
    let name = |path: &Path| path.file_name().map(|name| name.to_string_lossy().into_owned());
    name(root).or_else(|| name(&root.canonicalize().ok()?)).unwrap_or_else(|| "dataset".into())
}

#[cfg(test)]
mod tests;
