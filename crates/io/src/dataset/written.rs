//! The text of a declaration, in the short form where it is of one camera.

use std::path::Path;

use depthcal_model::{NumberedBoard, Pattern, Target};
use serde::{Serialize, Serializer};

use super::camera_hint::CameraHint;
use super::declaration::{CameraSection, DatasetFile};
use crate::file::{FileError, write_atomically};
use crate::image::Disparity;

/// The sections of `dataset.toml` in the order in which they are written.
#[derive(Serialize)]
struct Sections<'a> {
    #[serde(skip_serializing_if = "Option::is_none")]
    board: Option<&'a Target>,
    #[serde(skip_serializing_if = "Named::is_empty")]
    boards: Named<'a, Numbered<'a>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    frames: Option<Frames<'a>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    depth: Option<Depth>,
    #[serde(skip_serializing_if = "Option::is_none")]
    camera: Option<&'a CameraHint>,
    #[serde(skip_serializing_if = "Named::is_empty")]
    cameras: Named<'a, Camera<'a>>,
}

#[derive(Serialize)]
struct Frames<'a> {
    #[serde(flatten)]
    files: Files<'a>,
    #[serde(skip_serializing_if = "Option::is_none")]
    metadata: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    associations: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    within_s: Option<f64>,
}

#[derive(Default, Serialize)]
struct Files<'a> {
    #[serde(skip_serializing_if = "Option::is_none")]
    image: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    depth: Option<&'a str>,
}

#[derive(Serialize)]
struct Depth {
    #[serde(skip_serializing_if = "Option::is_none")]
    unit_mm: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    disparity: Option<Disparity>,
}

#[derive(Serialize)]
struct Camera<'a> {
    #[serde(flatten)]
    files: Files<'a>,
    #[serde(skip_serializing_if = "Option::is_none")]
    unit_mm: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    disparity: Option<Disparity>,
    #[serde(flatten)]
    camera: Option<&'a CameraHint>,
    #[serde(skip_serializing_if = "Option::is_none")]
    camera_from_rig: Option<[f64; 12]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    expected_from_rig: Option<[f64; 12]>,
}

#[derive(Serialize)]
struct Numbered<'a> {
    first_tag: usize,
    #[serde(flatten)]
    board: &'a Target,
}

/// Sections of a name each, in their order.
struct Named<'a, T>(Vec<(&'a str, T)>);

impl<T> Named<'_, T> {
    fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl<T: Serialize> Serialize for Named<'_, T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(name, section)| (name, section)))
    }
}

impl DatasetFile {
    /// The text of the file, in the short form where it declares one camera called [`CAMERA`](super::declaration::CAMERA).
    ///
    /// # Errors
    /// The serialiser's message, where a value has no TOML.
    pub fn to_toml(&self) -> Result<String, toml::ser::Error> {
        let short = self.cameras.first().filter(|_| self.is_short());
        let (board, boards) = match &self.board.pattern {
            Pattern::Several { boards } => (None, boards.iter().map(numbered).collect()),
            _ => (Some(&self.board), Vec::new()),
        };
        let frames = Frames {
            files: short.map(files).unwrap_or_default(),
            metadata: self.metadata.as_deref(),
            associations: self.associations.as_deref(),
            within_s: self.within_s,
        };
        let has_frames = short.is_some() || self.metadata.is_some() || self.within_s.is_some();
        let named = if short.is_some() { &[] } else { self.cameras.as_slice() };
        toml::to_string(&Sections {
            board,
            boards: Named(boards),
            frames: has_frames.then_some(frames),
            depth: short
                .filter(|camera| camera.has_unit())
                .map(|camera| Depth { unit_mm: camera.unit_mm, disparity: camera.disparity }),
            camera: short.and_then(|camera| camera.camera.as_ref()),
            cameras: Named(named.iter().map(|section| (section.name.as_str(), camera(section))).collect()),
        })
    }

    /// Writes the file atomically.
    ///
    /// # Errors
    /// [`FileError::Invalid`] when [`DatasetFile::read`] would refuse the contents; [`FileError::Write`].
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), FileError> {
        self.write_file(path.as_ref())
    }

    fn write_file(&self, path: &Path) -> Result<(), FileError> {
        let invalid = |problem| FileError::Invalid { path: path.to_owned(), field: ".".into(), problem };
        let text = self.to_toml().map_err(|error| invalid(error.to_string()))?;
        // A file that could not be read back is not written.
        Self::parse(path, &text).map_err(|error| invalid(format!("would not be accepted on reading: {error}")))?;
        write_atomically(path, |writer| writer.write_all(text.as_bytes()))
    }
}

fn numbered(board: &NumberedBoard) -> (&str, Numbered<'_>) {
    (&board.name, Numbered { first_tag: board.first_tag, board: &board.board })
}

fn camera(section: &CameraSection) -> Camera<'_> {
    Camera {
        files: files(section),
        unit_mm: section.unit_mm,
        disparity: section.disparity,
        camera: section.camera.as_ref(),
        camera_from_rig: section.camera_from_rig,
        expected_from_rig: section.expected_from_rig,
    }
}

fn files(section: &CameraSection) -> Files<'_> {
    Files { image: section.image.as_deref(), depth: section.depth.as_deref() }
}
