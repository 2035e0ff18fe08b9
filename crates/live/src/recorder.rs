//! The kept frames as a dataset that is complete after every frame.

use std::fmt::Write;
use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

use depthcal_io::{
    CameraSection, DATASET_FILE, Dataset, DatasetFile, DepthValues, FileError, FrameMetadata, read_depth_frame,
    read_gray, write_atomically, write_depth_frame, write_gray,
};
use depthcal_model::Target;

use crate::arrival::Arrival;
use crate::error::LiveError;

/// Name of the table of frames.
const TABLE: &str = "frames.csv";

/// Properties that all frames of a dataset share.
#[derive(Debug, Clone, PartialEq)]
struct Shape {
    size: [usize; 2],
    /// Unit and extension of the depth.
    depth: Option<(f64, &'static str)>,
}

impl Shape {
    fn of(arrival: &Arrival) -> Self {
        let depth = arrival.depth.as_ref().zip(arrival.unit_mm).map(|(depth, unit_mm)| match depth.values {
            DepthValues::Steps(_) => (unit_mm, "png"),
            DepthValues::Float(_) => (unit_mm, "npy"),
        });
        Self { size: [arrival.image.width, arrival.image.height], depth }
    }
}

/// Writes kept frames into a dataset folder, each at once and atomically: depth, the row of the table, then the image, which
/// makes it a frame. A run that was killed in between leaves a depth image or a row too many, which belong to no frame.
#[derive(Debug)]
pub struct Recorder {
    folder: PathBuf,
    target: Target,
    shape: Option<Shape>,
    rows: Vec<(String, FrameMetadata)>,
    /// Held as long as the folder is in use, where the system locks folders.
    _lock: Option<File>,
}

impl Recorder {
    /// Opens a folder, which is created if it does not exist, and returns the frames that it has already.
    ///
    /// # Errors
    /// [`LiveError::OtherDataset`]: it holds a dataset of another board, or not of this layout. [`LiveError::File`] where it
    /// cannot be written, or another session writes into it.
    pub fn open(folder: &Path, target: &Target) -> Result<(Self, Vec<Arrival>), LiveError> {
        let unwritable = |error| FileError::Write { path: folder.to_owned(), error };
        fs::create_dir_all(folder).map_err(unwritable)?;
        let lock = File::open(folder).ok();
        if let Some(Err(TryLockError::WouldBlock)) = lock.as_ref().map(File::try_lock) {
            let message = "another session keeps frames in this folder: end it, or give --out another one";
            return Err(unwritable(io::Error::new(io::ErrorKind::ResourceBusy, message)).into());
        }
        let mut recorder =
            Self { folder: folder.to_owned(), target: target.clone(), shape: None, rows: Vec::new(), _lock: lock };
        let earlier = recorder.earlier()?;
        for arrival in &earlier {
            recorder.shape.get_or_insert_with(|| Shape::of(arrival));
            recorder.rows.push((arrival.name.clone(), arrival.metadata.clone()));
        }
        Ok((recorder, earlier))
    }

    /// The frames of an earlier session.
    fn earlier(&self) -> Result<Vec<Arrival>, LiveError> {
        let other = |problem: &str| LiveError::OtherDataset { path: self.folder.clone(), problem: problem.to_owned() };
        let declaration = self.folder.join(DATASET_FILE);
        let has_images = fs::read_dir(self.folder.join("image")).is_ok_and(|mut files| files.next().is_some());
        if !declaration.exists() {
            return match has_images {
                true => Err(other("there are images already, but no dataset.toml")),
                false => Ok(Vec::new()),
            };
        }
        let declared = DatasetFile::read(&declaration)?;
        if declared.board != self.target {
            return Err(other("the dataset there has another board"));
        }
        let is_ours = |camera: &CameraSection| camera.image.as_deref() == Some("image/*.png");
        if !declared.is_short() || !declared.cameras.iter().all(is_ours) || declared.metadata.as_deref() != Some(TABLE)
        {
            return Err(other("the dataset there was not captured live"));
        }
        let is_image = |file: &fs::DirEntry| file.path().extension().is_some_and(|e| e == "png");
        let images = fs::read_dir(self.folder.join("image")).into_iter().flatten().flatten();
        if images.filter(is_image).count() == 0 {
            return Ok(Vec::new());
        }
        let camera = Dataset::open(&self.folder)?.into_only_camera()?;
        let unit_mm = camera.depth_unit_mm;
        let mut earlier = Vec::new();
        for frame in camera.frames {
            let Some(image) = &frame.image else { continue };
            let depth = frame.depth.as_deref().map(read_depth_frame).transpose()?;
            earlier.push(Arrival {
                name: frame.name,
                image: read_gray(image)?,
                unit_mm: unit_mm.filter(|_| depth.is_some()),
                depth,
                metadata: frame.metadata,
                is_video: false,
            });
        }
        Ok(earlier)
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Why a frame cannot be kept together with the others; `None` where it can.
    pub fn refusal(&self, arrival: &Arrival) -> Option<String> {
        let (shape, new) = (self.shape.as_ref()?, Shape::of(arrival));
        if new == *shape {
            return None;
        }
        let [width, height] = shape.size;
        Some(match (new.size == shape.size, new.depth.is_some(), shape.depth.is_some()) {
            (false, ..) => format!("its size is {} × {} px, not {width} × {height} px", new.size[0], new.size[1]),
            (_, false, true) => "it has no depth, as the others have".to_owned(),
            (_, true, false) => "it has depth, which the others have not".to_owned(),
            _ => "its depth is of another unit or type than that of the others".to_owned(),
        })
    }

    /// Writes a frame, and returns its name.
    ///
    /// # Errors
    /// [`LiveError::File`] where a file cannot be written; the dataset is then as it was.
    pub fn keep(&mut self, arrival: &Arrival) -> Result<String, LiveError> {
        let number = self.rows.iter().filter_map(|(name, _)| name.parse::<u32>().ok()).max().map_or(1, |last| last + 1);
        let name = format!("{number:04}");
        let shape = self.shape.clone().unwrap_or_else(|| Shape::of(arrival));
        if let (Some(depth), Some((_, extension))) = (&arrival.depth, &shape.depth) {
            write_depth_frame(self.folder.join(format!("depth/{name}.{extension}")), depth)?;
        }
        self.rows.push((name.clone(), arrival.metadata.clone()));
        let written = self.write_table().and_then(|()| {
            if self.shape.is_none() {
                self.write_declaration(&shape)?;
            }
            Ok(write_gray(self.folder.join(format!("image/{name}.png")), &arrival.image)?)
        });
        match written {
            Ok(()) => {
                self.shape = Some(shape);
                Ok(name)
            }
            Err(error) => {
                self.rows.pop();
                Err(error)
            }
        }
    }

    /// Removes a frame: the image first, without which it is none.
    ///
    /// # Errors
    /// [`LiveError::Folder`] where its image cannot be removed.
    pub fn take_back(&mut self, name: &str) -> Result<(), LiveError> {
        let path = self.folder.join(format!("image/{name}.png"));
        fs::remove_file(&path).map_err(|error| LiveError::Folder { path, error })?;
        if let Some((_, extension)) = self.shape.as_ref().and_then(|shape| shape.depth) {
            // A depth image that stays belongs to no frame.
            let _ = fs::remove_file(self.folder.join(format!("depth/{name}.{extension}")));
        }
        self.rows.retain(|(row, _)| row != name);
        if self.rows.is_empty() {
            self.shape = None;
        }
        self.write_table()
    }

    fn write_table(&self) -> Result<(), LiveError> {
        let mut text = String::from("frame,timestamp_s,temperature_c\n");
        let cell = |value: Option<f64>| value.map_or_else(String::new, |value| value.to_string());
        for (name, metadata) in &self.rows {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{name},{},{}", cell(metadata.timestamp_s), cell(metadata.temperature_c));
        }
        Ok(write_atomically(self.folder.join(TABLE), |file| file.write_all(text.as_bytes()))?)
    }

    fn write_declaration(&self, shape: &Shape) -> Result<(), LiveError> {
        let path = self.folder.join(DATASET_FILE);
        let declaration = DatasetFile {
            board: self.target.clone(),
            metadata: Some(TABLE.to_owned()),
            associations: None,
            within_s: None,
            cameras: vec![CameraSection {
                image: Some("image/*.png".to_owned()),
                depth: shape.depth.map(|(_, extension)| format!("depth/*.{extension}")),
                unit_mm: shape.depth.map(|(unit_mm, _)| unit_mm),
                ..CameraSection::default()
            }],
        };
        let invalid = |error: &dyn std::fmt::Display| {
            let problem = format!("cannot be written: {error}");
            LiveError::OtherDataset { path: path.clone(), problem }
        };
        let text = declaration.to_toml().map_err(|error| invalid(&error))?;
        // A file that could not be read back is not written.
        DatasetFile::parse(&path, &text).map_err(|error| invalid(&error))?;
        Ok(write_atomically(&path, |file| file.write_all(text.as_bytes()))?)
    }
}
