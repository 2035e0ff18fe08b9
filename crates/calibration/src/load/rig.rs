//! From a dataset of a rig on disk to what its cameras observed.

use std::path::Path;

use crate::load::{LoadOptions, Loaded, declared_camera, load_dataset, load_depth_only};
use depthcal_io::{Calibration, RigDataset};
use depthcal_model::Register;

use super::error::LoadError;
use crate::observe::{CameraCapture, RigCapture};

/// A dataset of a rig, read.
#[derive(Debug, Clone)]
pub struct LoadedRig {
    /// What was declared.
    pub dataset: RigDataset,
    /// Every camera's part of it, in the order of the cameras.
    pub cameras: Vec<Loaded>,
    /// What was observed.
    pub capture: RigCapture,
}

impl LoadedRig {
    /// Whether a calibration was fitted to this dataset.
    pub fn is_fitted_by(&self, calibration: &Calibration) -> bool {
        self.cameras.first().is_some_and(|camera| camera.reference.digest == calibration.dataset.digest)
    }
}

/// Reads a dataset: images and depth images of every camera, and the board in every image.
///
/// # Errors
///
/// [`LoadError`], naming the camera, the file or field, what is wrong and the remedy.
pub fn load_rig(path: &Path, options: &LoadOptions) -> Result<LoadedRig, LoadError> {
    let dataset = RigDataset::open(path)?;
    let mut cameras = Vec::new();
    let mut captures = Vec::new();
    for member in &dataset.cameras {
        let name = member.name.clone();
        let own = member.dataset.clone();
        let loaded = if member.has_images() {
            load_dataset(with_images(own), path, options)
        } else {
            load_depth_only(own, path, options)
        };
        let loaded = loaded.map_err(|source| LoadError::Camera { camera: name.clone(), source: Box::new(source) })?;
        captures.push(camera_capture(name, &loaded, &options.register)?);
        cameras.push(loaded);
    }
    let capture = RigCapture { name: dataset.name.clone(), cameras: captures };
    Ok(LoadedRig { dataset, cameras, capture })
}

/// Frames of a camera with images that lack theirs are strays: their depth has no pose of this camera's own.
fn with_images(mut dataset: depthcal_io::Dataset) -> depthcal_io::Dataset {
    let (with, without): (Vec<_>, Vec<_>) = dataset.frames.into_iter().partition(|frame| frame.image.is_some());
    dataset.frames = with;
    let stray = |frame: depthcal_io::Frame| depthcal_io::Stray {
        name: frame.name,
        reason: "this camera has depth but no image of it".to_owned(),
    };
    dataset.strays.extend(without.into_iter().map(stray));
    dataset
}

fn camera_capture(name: String, loaded: &Loaded, register: &Register) -> Result<CameraCapture, LoadError> {
    let (width, height) = (loaded.capture.width, loaded.capture.height);
    let declared = declared_camera(&loaded.dataset, width, height, None, register)
        .map_err(|source| LoadError::Camera { camera: name.clone(), source: Box::new(source.into()) })?;
    let lens = loaded.dataset.camera.as_ref().and_then(|camera| camera.lens.clone());
    Ok(CameraCapture { name, capture: loaded.capture.clone(), declared, lens })
}
