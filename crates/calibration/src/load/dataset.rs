//! From a dataset on disk to the observations of its cameras: images are read, boards detected (or their cached detections read),
//! depth images paired.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use depthcal_io::{
    Calibration, DATASET_FILE, Dataset, DatasetCamera, DatasetError, DepthFrame, FileReference, FrameObservations,
    GrayImage, Observations, check_same_size, digest_files, read_gray,
};
use depthcal_model::{BoardPart, CharucoLayout, Register};
use nalgebra::{Isometry3, Matrix3x4, Translation3, UnitQuaternion};
use rayon::prelude::*;
use tracing::{debug, info, warn};

use super::cache::{self, DETECTION, DETECTION_VERSION, LAYOUT};
use super::circle_diameter::MeasuredDiameter;
use super::declared_camera::declared_camera;
#[cfg(feature = "detect")]
use super::detection::find_board;
use super::error::LoadError;
use super::found::Found;
use super::given_markers::given_markers;
use super::marker_lists::{GivenMarkers, markers_of};
use super::per_board::{markers_per_board, per_board};
use super::same_frames::drop_copies;
use crate::observe::stored::{ImageFile, depth_digest};
use crate::observe::{
    CameraCapture, CameraFrames, Capture, DetectedFrame, DroppedFrame, MeasuredDepth, RawFrame, Stored,
};
use crate::progress::ProgressHandle;

/// The setting that names the file of markers that another program found.
const MARKERS: &str = "markers";

/// How a dataset is read.
#[derive(Debug, Clone)]
pub struct LoadOptions {
    /// Folder of cached detections; `None` neither reads nor writes any.
    pub cache: Option<PathBuf>,
    /// Detects again even where a cached detection holds.
    pub refresh: bool,
    /// File of markers that another program found, in mrcal's format of corners; the board is then not detected, and nothing is
    /// cached.
    pub markers: Option<PathBuf>,
    /// Pieces that the camera of circle refinement may have.
    pub register: Register,
    /// Bytes of images that stay in memory; the images of further frames are read again from their files when they are needed.
    pub image_memory: usize,
    /// Receives progress.
    pub progress: ProgressHandle,
}

/// Default of [`LoadOptions::image_memory`]: some 800 frames of 640×480.
const IMAGE_MEMORY: usize = 1 << 30;

impl Default for LoadOptions {
    fn default() -> Self {
        Self {
            cache: default_cache(),
            refresh: false,
            markers: None,
            register: Register::builtin(),
            image_memory: IMAGE_MEMORY,
            progress: ProgressHandle::default(),
        }
    }
}

/// Where detections are cached: `DEPTHCAL_CACHE`, else `depthcal` in the user's cache folder.
pub fn default_cache() -> Option<PathBuf> {
    let set = |name: &str| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
    set("DEPTHCAL_CACHE")
        .or_else(|| set("XDG_CACHE_HOME").map(|c| c.join("depthcal")))
        .or_else(|| set("HOME").map(|h| h.join(".cache").join("depthcal")))
}

/// A dataset, read.
#[derive(Debug, Clone)]
pub struct Loaded {
    /// Its name.
    pub name: String,
    /// Every camera's part of it, the reference first.
    pub cameras: Vec<LoadedCamera>,
}

/// A camera of a dataset: its declaration and its observations.
#[derive(Debug, Clone)]
pub struct LoadedCamera {
    /// Declaration in `dataset.toml`; a diameter of dots that it does not give is the measured one.
    pub declared: DatasetCamera,
    /// Path and digest, for the record.
    pub reference: FileReference,
    /// Observations; frames of a camera without images have no markers.
    pub capture: CameraFrames,
    /// Whether the markers came from the cache.
    pub from_cache: bool,
    /// The diameter of the board's dots, measured in the images; `None` for boards without dots.
    pub circle_diameter: Option<MeasuredDiameter>,
    /// The layout of a ChArUco board of which there are two; `None` for other boards.
    pub charuco_layout: Option<CharucoLayout>,
    /// The file from which the markers are, with its digest; `None` where they were detected.
    pub markers: Option<FileReference>,
}

impl Loaded {
    /// A dataset of one camera.
    pub fn of_camera(camera: LoadedCamera) -> Self {
        Self { name: camera.declared.title.clone(), cameras: vec![camera] }
    }

    /// The camera of a dataset that has one.
    ///
    /// # Errors
    ///
    /// [`DatasetError::SeveralCameras`].
    pub fn only_camera(&self) -> Result<&LoadedCamera, LoadError> {
        match self.cameras.as_slice() {
            [camera] => Ok(camera),
            [] => Err(LoadError::NoImages { root: PathBuf::from(&self.name) }),
            [camera, ..] => {
                let path = camera.declared.root.join(DATASET_FILE);
                Err(DatasetError::SeveralCameras { path }.into())
            }
        }
    }

    /// The camera of a dataset that has one.
    ///
    /// # Errors
    ///
    /// As [`only_camera`](Self::only_camera).
    pub fn into_only_camera(mut self) -> Result<LoadedCamera, LoadError> {
        self.only_camera()?;
        self.cameras.pop().ok_or_else(|| LoadError::NoImages { root: PathBuf::from(self.name) })
    }

    /// Whether a calibration was fitted to this dataset.
    pub fn is_fitted_by(&self, calibration: &Calibration) -> bool {
        self.cameras.first().is_some_and(|camera| camera.reference.digest == calibration.dataset.digest)
    }

    /// Observations of all cameras, without declared intrinsics.
    pub fn observed(&self) -> Capture {
        let camera = |loaded: &LoadedCamera| CameraCapture {
            name: loaded.declared.name.clone(),
            capture: loaded.capture.clone(),
            declared: None,
            lens: loaded.declared.camera.as_ref().and_then(|camera| camera.lens.clone()),
            camera_from_rig: loaded.declared.camera_from_rig.map(rigid_motion),
            expected_from_rig: loaded.declared.expected_from_rig.map(rigid_motion),
        };
        Capture { name: self.name.clone(), cameras: self.cameras.iter().map(camera).collect() }
    }

    /// Observations of all cameras, with the intrinsics that the dataset declares. `lens` is the lens model that is asked for
    /// whatever the dataset declares.
    ///
    /// # Errors
    ///
    /// [`LoadError::Declared`], [`LoadError::Camera`] where a declared camera cannot be used.
    pub fn capture(&self, lens: Option<&str>, register: &Register) -> Result<Capture, LoadError> {
        let mut capture = self.observed();
        for (camera, loaded) in capture.cameras.iter_mut().zip(&self.cameras) {
            let (width, height) = (loaded.capture.width, loaded.capture.height);
            let declared = declared_camera(&loaded.declared, width, height, lens, register).map_err(LoadError::from);
            camera.declared = match self.cameras.len() {
                1 => declared?,
                _ => declared.map_err(|e| LoadError::Camera { camera: camera.name.clone(), source: Box::new(e) })?,
            };
        }
        Ok(capture)
    }
}

impl LoadedCamera {
    /// A capture whose markers, if it has any, are given: nothing was detected or measured in its images.
    pub fn of_capture(declared: DatasetCamera, reference: FileReference, capture: CameraFrames) -> Self {
        Self {
            declared,
            reference,
            capture,
            from_cache: false,
            circle_diameter: None,
            charuco_layout: None,
            markers: None,
        }
    }

    /// The camera's name.
    pub fn name(&self) -> &str {
        &self.declared.name
    }

    /// Whether the board was found in its images.
    pub fn has_markers(&self) -> bool {
        self.capture.frames.iter().any(|frame| !frame.markers.is_empty())
    }

    /// The observations of markers, for `observations.json`.
    pub fn observations(&self) -> Observations {
        let frames = self.capture.frames.iter().map(|frame| FrameObservations {
            name: frame.name.clone(),
            width: self.capture.width,
            height: self.capture.height,
            markers: frame.markers.clone(),
            depth: Vec::new(),
            metadata: frame.metadata.clone(),
        });
        Observations {
            dataset: self.reference.clone(),
            target: self.capture.target.clone(),
            settings: self.settings(),
            frames: frames.collect(),
        }
    }

    /// How the markers were found.
    fn settings(&self) -> BTreeMap<String, String> {
        let origin = match &self.markers {
            Some(file) => (MARKERS, format!("{} {}", file.path, file.digest)),
            None => (DETECTION, DETECTION_VERSION.to_owned()),
        };
        let layout = self.charuco_layout.map(|layout| (LAYOUT, layout.name().to_owned()));
        let marker_settings = layout.into_iter().chain([origin]).map(|(name, value)| (name.to_owned(), value));
        self.circle_diameter.into_iter().flat_map(MeasuredDiameter::to_settings).chain(marker_settings).collect()
    }
}

/// Reads a dataset: images and depth images of every camera, and the board in every image. A camera without images has depth
/// alone.
///
/// # Errors
///
/// [`LoadError`], naming the camera where there are several, the file or field, what is wrong and the remedy.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Loaded, LoadError> {
    let dataset = Dataset::open(path)?;
    if !dataset.cameras.iter().any(DatasetCamera::has_images) {
        return Err(LoadError::NoImages { root: dataset.root });
    }
    let is_only = dataset.cameras.len() == 1;
    let read = |declared: DatasetCamera| {
        let camera = declared.name.clone();
        let read = if declared.has_images() {
            read_camera(declared, path, None, options)
        } else {
            read_depth_only(declared, path, options)
        };
        read.map_err(|source| match is_only {
            true => source,
            false => LoadError::Camera { camera, source: Box::new(source) },
        })
    };
    Ok(Loaded { name: dataset.name, cameras: dataset.cameras.into_iter().map(read).collect::<Result<_, _>>()? })
}

/// Reads a dataset of one camera whose markers were found by another program: positions by the names of frames. Frames without
/// markers are dropped, as those are in which no board is found. Nothing is cached, and the diameter of dots is not measured.
///
/// # Errors
///
/// [`LoadError`]; [`LoadError::Marker`] where a name or a marker's number does not exist.
pub fn load_with_markers(path: &Path, markers: &GivenMarkers, options: &LoadOptions) -> Result<Loaded, LoadError> {
    let declared = Dataset::open(path)?.into_only_camera()?;
    Ok(Loaded::of_camera(read_camera(declared, path, Some(markers), options)?))
}

/// Reads the images and the depth images of a camera, and the board in its images; `path` is what the record names.
fn read_camera(
    dataset: DatasetCamera,
    path: &Path,
    given: Option<&GivenMarkers>,
    options: &LoadOptions,
) -> Result<LoadedCamera, LoadError> {
    if dataset.frames.iter().any(|f| f.image.is_none()) || dataset.frames.is_empty() {
        return Err(LoadError::NoImages { root: dataset.root });
    }
    let digesting = options.progress.stage("digest of the files");
    let digest = dataset.digest()?;
    drop(digesting);
    let reference = FileReference { path: path.display().to_string(), digest: digest.clone() };
    let (frames, (width, height)) = read_frames(&dataset, options.image_memory, &options.progress)?;
    if let Some(given) = given {
        let names: Vec<&str> = frames.iter().map(|frame| frame.name.as_str()).collect();
        let detected = Found { markers: markers_of(&names, &dataset.target, given)?, ..Found::default() };
        return Ok(assemble(dataset, reference, frames, (width, height), detected, None)?.0);
    }
    let file = options.markers.as_deref();
    let cache_path =
        options.cache.as_ref().filter(|_| file.is_none()).map(|folder| folder.join(format!("{digest}.json")));
    let cached = cache_path.as_ref().filter(|_| !options.refresh).and_then(|path| cache::read(path, &digest, &dataset));
    let from_cache = cached.is_some();
    let detected = match (cached, file) {
        (Some(detected), _) => {
            debug!("markers of {} come from the cache", dataset.title);
            detected
        }
        (None, Some(file)) => given_markers(file, &dataset, (width, height))?,
        (None, None) => find_board(&dataset.root, &dataset.target, &frames, &options.register, &options.progress)?,
    };
    let file = file.map(|file| {
        let digest = digest_files(file.parent().unwrap_or(Path::new("")), &[file.to_owned()])?;
        Ok::<_, LoadError>(FileReference { path: file.display().to_string(), digest })
    });
    let (mut loaded, without_board) =
        assemble(dataset, reference, frames, (width, height), detected, file.transpose()?)?;
    loaded.from_cache = from_cache;
    if let (Some(path), false) = (cache_path, from_cache) {
        let without = &loaded.capture.dropped[..without_board];
        cache::write(&path, loaded.observations(), without, [width, height]);
    }
    Ok(loaded)
}

/// A dataset from frames of one size and their markers, which come from `file` where another program found them, and the number
/// of frames without a board, which come first among those that are dropped.
pub(super) fn assemble(
    mut dataset: DatasetCamera,
    reference: FileReference,
    frames: Vec<RawFrame>,
    (width, height): (usize, usize),
    Found { markers, circle_diameter, charuco_layout, tried }: Found,
    file: Option<FileReference>,
) -> Result<(LoadedCamera, usize), LoadError> {
    if let Some(measured) = circle_diameter {
        if measured.contradicts_declaration() {
            warn!("{}: {measured}", dataset.title);
        } else {
            info!("{}: {measured}", dataset.title);
        }
        if measured.declared_mm.is_none() {
            dataset.target = dataset.target.with_circle_diameter_mm(measured.diameter_mm);
        }
    }
    let mut dropped = Vec::new();
    let mut frames_with_board = Vec::new();
    let target = &dataset.target;
    let of_boards = frames.into_iter().zip(markers).flat_map(|(raw, markers)| {
        per_board(raw, target).into_iter().zip(markers_per_board(&markers, target)).collect::<Vec<_>>()
    });
    for (raw, markers) in of_boards {
        if markers.is_empty() {
            let reason = match &file {
                Some(file) => format!("no markers in {}", file.path),
                None => "the board was not found".to_owned(),
            };
            dropped.push(DroppedFrame { name: raw.name, reason });
        } else {
            frames_with_board.push(DetectedFrame { raw, markers, ..DetectedFrame::default() });
        }
    }
    if frames_with_board.is_empty() {
        let size = |part: &BoardPart<'_>| format!("{} × {}", part.board.columns, part.board.rows);
        let board = dataset.target.parts().iter().map(size).collect::<Vec<_>>().join(", ");
        return Err(LoadError::NoBoard { root: dataset.root, board, frames: dropped.len(), tried });
    }
    let (with_board, all) = (frames_with_board.len(), frames_with_board.len() + dropped.len());
    info!("{}: the board was found in {with_board} of {all} frames", dataset.title);
    let without_board = dropped.len();
    drop_copies(&mut frames_with_board, &mut dropped);
    dropped.extend(dataset.strays.iter().map(|s| DroppedFrame { name: s.name.clone(), reason: s.reason.clone() }));
    let capture = CameraFrames {
        name: dataset.title.clone(),
        target: dataset.target.clone(),
        width,
        height,
        depth_unit_mm: dataset.depth_unit_mm,
        disparity: dataset.disparity,
        technology: dataset.technology(),
        frames: frames_with_board,
        dropped,
    };
    let given = LoadedCamera::of_capture(dataset, reference, capture);
    Ok((LoadedCamera { circle_diameter, charuco_layout, markers: file, ..given }, without_board))
}

/// Reads the depth images of a camera that has no images: frames without markers.
fn read_depth_only(dataset: DatasetCamera, path: &Path, options: &LoadOptions) -> Result<LoadedCamera, LoadError> {
    let digest = dataset.digest()?;
    let reference = FileReference { path: path.display().to_string(), digest };
    let (frames, (width, height)) = read_frames(&dataset, options.image_memory, &options.progress)?;
    let detected = |raw| DetectedFrame { raw, ..DetectedFrame::default() };
    let strays = dataset.strays.iter().map(|s| DroppedFrame { name: s.name.clone(), reason: s.reason.clone() });
    let capture = CameraFrames {
        name: dataset.title.clone(),
        target: dataset.target.clone(),
        width,
        height,
        depth_unit_mm: dataset.depth_unit_mm,
        disparity: dataset.disparity,
        technology: dataset.technology(),
        frames: frames.into_iter().flat_map(|raw| per_board(raw, &dataset.target)).map(detected).collect(),
        dropped: strays.collect(),
    };
    Ok(LoadedCamera::of_capture(dataset, reference, capture))
}

/// An image that stays in memory, or is read again from its file.
fn store<T: ImageFile>(stays: bool, path: &Path, image: T) -> Stored<T> {
    if stays { image.into() } else { Stored::File(Arc::new(path.to_owned())) }
}

/// All images and depth images, and their common size.
fn read_frames(
    dataset: &DatasetCamera,
    image_memory: usize,
    progress: &ProgressHandle,
) -> Result<(Vec<RawFrame>, (usize, usize)), LoadError> {
    let job = progress.steps("reading images", dataset.frames.len());
    type Read = Result<(RawFrame, PathBuf, (usize, usize)), LoadError>;
    let read: Vec<Read> = dataset
        .frames
        .par_iter()
        .enumerate()
        .map(|(number, frame)| {
            let image: Option<GrayImage> = frame.image.as_deref().map(read_gray).transpose()?;
            let depth: Option<DepthFrame> = match &frame.depth {
                Some(depth_path) => {
                    let depth = dataset.read_depth(depth_path)?;
                    if let (Some(path), Some(image)) = (&frame.image, &image) {
                        check_same_size(
                            (path, [image.width, image.height]),
                            (depth_path, [depth.width, depth.height]),
                        )?;
                    }
                    Some(depth)
                }
                None => None,
            };
            let path = frame.image.as_ref().or(frame.depth.as_ref()).cloned().unwrap_or_default();
            let of_depth = depth.as_ref().map(|depth| (depth.width, depth.height));
            let size = image.as_ref().map(|image| (image.width, image.height)).or(of_depth).unwrap_or_default();
            job.advance();
            // Frames are kept in memory in their order until it is used up; the others are read again when they are needed.
            let bytes = image.as_ref().map_or(0, ImageFile::bytes) + depth.as_ref().map_or(0, ImageFile::bytes);
            let stays = (number + 1) * bytes <= image_memory;
            let depth_digest = depth.as_ref().and_then(depth_digest);
            // What was made of disparities is in no file.
            let depth_stays = stays || dataset.disparity.is_some();
            let depth = frame.depth.as_ref().zip(depth).map(|(path, depth)| store(depth_stays, path, depth));
            let frame = RawFrame {
                depth: depth.map_or(MeasuredDepth::None, MeasuredDepth::Image),
                image: frame.image.as_ref().zip(image).map(|(path, image)| store(stays, path, image)),
                depth_digest,
                ..RawFrame::named(&frame.name, &frame.metadata)
            };
            Ok((frame, path, size))
        })
        .collect();
    let usual = usual_size(read.iter().flatten().map(|(.., size)| *size));
    let mut frames = Vec::with_capacity(read.len());
    for item in read {
        let (frame, path, size) = item.map_err(|error| error.of_usual_size(usual))?;
        if size != usual {
            return Err(LoadError::Size { path, found: size, expected: usual });
        }
        frames.push(frame);
    }
    since_first(&mut frames);
    Ok((frames, usual))
}

/// The size that most frames have, of several the largest.
fn usual_size(sizes: impl Iterator<Item = (usize, usize)>) -> (usize, usize) {
    let mut counts: BTreeMap<(usize, usize), usize> = BTreeMap::new();
    sizes.for_each(|size| *counts.entry(size).or_default() += 1);
    counts.into_iter().max_by_key(|(_, count)| *count).map_or((0, 0), |(size, _)| size)
}

/// Times since the first frame, so that a drift's start does not depend on the clock.
pub(super) fn since_first(frames: &mut [RawFrame]) {
    let first = frames.iter().map(|f| f.time_s).fold(f64::INFINITY, f64::min);
    for frame in frames {
        frame.time_s -= first;
    }
}

#[cfg(not(feature = "detect"))]
fn find_board(
    root: &Path,
    _target: &depthcal_model::Target,
    _frames: &[RawFrame],
    _register: &Register,
    _progress: &ProgressHandle,
) -> Result<Found, LoadError> {
    Err(LoadError::NoDetection { root: root.to_owned() })
}

/// The rigid motion of the rows of (R | t), with the rotation next to R.
fn rigid_motion(rows: [f64; 12]) -> Isometry3<f64> {
    let matrix = Matrix3x4::from_row_slice(&rows);
    let rotation = UnitQuaternion::from_matrix(&matrix.fixed_columns::<3>(0).into_owned());
    Isometry3::from_parts(Translation3::from(matrix.column(3).into_owned()), rotation)
}
