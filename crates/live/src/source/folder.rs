//! A folder that fills.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use depthcal_io::{
    DATASET_FILE, DEPTH_EXTENSIONS, Dataset, DatasetFile, FrameMetadata, IMAGE_EXTENSIONS, is_temporary,
    read_depth_frame, read_gray,
};
use tracing::warn;

use crate::arrival::Arrival;
use crate::error::LiveError;
use crate::inbox::{Inbox, SourceEnd};

/// Time between two looks at the folder.
const PERIOD: Duration = Duration::from_millis(50);
/// Looks after which a file that cannot be read is given up: it was not being written any more.
const MOST_TRIES: u32 = 40;

/// A frame in the folder.
#[derive(Debug, Clone)]
struct Listed {
    image: PathBuf,
    depth: Option<PathBuf>,
    metadata: FrameMetadata,
}

/// The progress of a frame that was listed.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Known {
    /// The bytes of its files at the last look, and the number of looks since it could not be read.
    Waiting { bytes: u64, tries: u32 },
    /// It has been read or given up.
    Done,
}

/// A folder that fills. Its files are told apart by their names; a file is read when it is as long as at the look before.
pub(super) struct Folder {
    path: PathBuf,
    unit_mm: Option<f64>,
    is_video: bool,
    known: BTreeMap<String, Known>,
}

impl Folder {
    pub(super) fn open(path: PathBuf, unit_mm: Option<f64>, is_video: bool) -> Result<Self, LiveError> {
        if !path.is_dir() {
            return Err(LiveError::NoFolder { path });
        }
        let declaration = path.join(DATASET_FILE);
        let declared = match declaration.is_file() {
            true => DatasetFile::read(&declaration)?.cameras.first().and_then(|camera| camera.unit_mm),
            false => None,
        };
        let unit_mm = declared.or(unit_mm);
        if unit_mm.is_none() && path.join("depth").is_dir() {
            return Err(LiveError::NoUnit { path });
        }
        Ok(Self { path, unit_mm, is_video, known: BTreeMap::new() })
    }

    /// Puts every frame into the inbox as its files come, until the inbox is closed or the folder is gone.
    pub(super) fn watch(&mut self, inbox: &Inbox) -> SourceEnd {
        loop {
            let listed = match self.list() {
                Ok(listed) => listed,
                Err(error) if self.path.is_dir() => {
                    warn!("{error}");
                    Vec::new()
                }
                Err(error) => return SourceEnd { problem: Some(error.to_string()) },
            };
            // Names of files that are gone are forgotten, so that a folder that is emptied now and then takes no memory.
            let names: BTreeSet<&String> = listed.iter().map(|(name, _)| name).collect();
            self.known.retain(|name, _| names.contains(name));
            for (name, frame) in &listed {
                if let Some(arrival) = self.look_at(name, frame)
                    && !inbox.put_frame(arrival)
                {
                    return SourceEnd { problem: None };
                }
            }
            if !inbox.is_open_after(PERIOD) {
                return SourceEnd { problem: None };
            }
        }
    }

    /// The frame, once its files are complete.
    fn look_at(&mut self, name: &str, frame: &Listed) -> Option<Arrival> {
        let bytes = [Some(&frame.image), frame.depth.as_ref()].into_iter().flatten();
        let bytes: u64 = bytes.map(|path| fs::metadata(path).map_or(0, |metadata| metadata.len())).sum();
        let known = self.known.entry(name.to_owned()).or_insert(Known::Waiting { bytes: u64::MAX, tries: 0 });
        let Known::Waiting { bytes: before, tries } = *known else { return None };
        if bytes != before {
            *known = Known::Waiting { bytes, tries };
            return None;
        }
        let read = || -> Result<Arrival, depthcal_io::ImageError> {
            let depth = frame.depth.as_deref().map(read_depth_frame).transpose()?;
            let unit_mm = self.unit_mm.filter(|_| depth.is_some());
            if let (Some(depth), Some(unit), Some(path)) = (&depth, unit_mm, &frame.depth) {
                depth.check_unit(path, unit)?;
            }
            let (image, metadata) = (read_gray(&frame.image)?, frame.metadata.clone());
            Ok(Arrival { name: name.to_owned(), image, depth, unit_mm, metadata, is_video: self.is_video })
        };
        match read() {
            Ok(arrival) => {
                *known = Known::Done;
                Some(arrival)
            }
            Err(error) => {
                *known = Known::Waiting { bytes, tries: tries + 1 };
                if tries + 1 >= MOST_TRIES {
                    warn!("{error}");
                    *known = Known::Done;
                }
                None
            }
        }
    }

    /// The frames that are there, in the order of their names.
    fn list(&self) -> Result<Vec<(String, Listed)>, LiveError> {
        if self.path.join(DATASET_FILE).is_file() {
            // A folder without frames yet is no dataset.
            let Ok(dataset) = Dataset::open(&self.path) else { return Ok(Vec::new()) };
            let frames = dataset.cameras.into_iter().next().map(|camera| camera.frames).unwrap_or_default();
            let listed = frames.into_iter().filter_map(|frame| {
                let listed = Listed { image: frame.image?, depth: frame.depth, metadata: frame.metadata };
                Some((frame.name, listed))
            });
            return Ok(listed.collect());
        }
        let has_folders = self.path.join("image").is_dir();
        let images = if has_folders { self.path.join("image") } else { self.path.clone() };
        let (images, with_depth) = (files(&images, IMAGE_EXTENSIONS)?, self.path.join("depth").is_dir());
        let mut depths = match with_depth {
            true => files(&self.path.join("depth"), DEPTH_EXTENSIONS)?,
            false => BTreeMap::new(),
        };
        // Depth comes with every image or with none: an image is complete once its depth is there.
        let listed = images.into_iter().filter_map(|(name, image)| {
            let depth = depths.remove(&name);
            let complete = depth.is_some() || !with_depth;
            complete.then_some((name, Listed { image, depth, metadata: FrameMetadata::default() }))
        });
        Ok(listed.collect())
    }
}

/// Files of a folder by their stems; those that depthcal or another program still writes, with a dot before their names, are not
/// among them.
fn files(folder: &Path, extensions: &[&str]) -> Result<BTreeMap<String, PathBuf>, LiveError> {
    let unreadable = |error| LiveError::Folder { path: folder.to_owned(), error };
    let mut files = BTreeMap::new();
    for entry in fs::read_dir(folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        let (Some(name), Some(stem), Some(extension)) = (path.file_name(), path.file_stem(), path.extension()) else {
            continue;
        };
        let is_hidden = is_temporary(name) || name.to_string_lossy().starts_with('.');
        let extension = extension.to_string_lossy().to_lowercase();
        if !is_hidden && extensions.contains(&extension.as_str()) {
            files.insert(stem.to_string_lossy().into_owned(), path);
        }
    }
    Ok(files)
}
