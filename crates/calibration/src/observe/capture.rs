//! Observations of the cameras of a capture.

use std::collections::BTreeSet;

use crate::observe::CameraFrames;
use depthcal_model::Camera;
use nalgebra::Isometry3;

/// The frames of all cameras that were captured together, of which there may be one. Frames of different cameras that were taken
/// together have the same name.
#[derive(Debug, Clone)]
pub struct Capture {
    /// The dataset's name.
    pub name: String,
    /// The cameras; the first is the reference.
    pub cameras: Vec<CameraCapture>,
}

/// Observations of one camera of a capture.
#[derive(Debug, Clone)]
pub struct CameraCapture {
    /// The camera's name.
    pub name: String,
    /// Its frames. Those of a camera without images have no markers.
    pub capture: CameraFrames,
    /// A camera to start from or, where its parameters are held, to keep.
    pub declared: Option<Camera>,
    /// The lens model that the dataset declares.
    pub lens: Option<String>,
    /// Its extrinsics where they are known: no fit changes them.
    pub camera_from_rig: Option<Isometry3<f64>>,
    /// Extrinsics that are expected: a fit is held against them.
    pub expected_from_rig: Option<Isometry3<f64>>,
}

impl CameraCapture {
    /// The frames of a camera of which nothing is declared.
    pub fn of(name: &str, capture: CameraFrames) -> Self {
        let (declared, lens) = (None, None);
        Self { name: name.to_owned(), capture, declared, lens, camera_from_rig: None, expected_from_rig: None }
    }

    /// Whether it has images in which the board was found.
    pub fn has_markers(&self) -> bool {
        self.capture.frames.iter().any(|frame| !frame.markers.is_empty())
    }
}

impl Capture {
    /// The frames of a camera that is alone.
    pub fn of_camera(camera: &str, capture: CameraFrames) -> Self {
        Self { name: capture.name.clone(), cameras: vec![CameraCapture::of(camera, capture)] }
    }

    /// Names of all frames, in the order in which cameras have them: those of the first camera first.
    pub fn frame_names(&self) -> Vec<String> {
        let mut names: Vec<String> = Vec::new();
        let mut known = BTreeSet::new();
        for frame in self.cameras.iter().flat_map(|camera| &camera.capture.frames) {
            if known.insert(frame.name.clone()) {
                names.push(frame.name.clone());
            }
        }
        names
    }

    /// This capture with only those frames for which `keep`, given the name, is true.
    #[must_use]
    pub fn subset(&self, keep: impl Fn(&str) -> bool) -> Self {
        let camera = |camera: &CameraCapture| CameraCapture {
            capture: camera.capture.subset(|_, frame| keep(&frame.name)),
            ..camera.clone()
        };
        Self { name: self.name.clone(), cameras: self.cameras.iter().map(camera).collect() }
    }

    /// Whether any camera has depth.
    pub fn has_depth(&self) -> bool {
        self.cameras.iter().any(|camera| camera.capture.has_depth())
    }

    /// The frames to fit and the held-out ones, every `every`-th counted from `first`.
    pub fn split(&self, every: usize, first: usize) -> (Self, Self) {
        let names = self.frame_names();
        let held: BTreeSet<&str> = names.iter().skip(first).step_by(every).map(String::as_str).collect();
        let mut held_out = self.subset(|name| held.contains(name));
        held_out.cameras.iter_mut().for_each(|camera| camera.capture.dropped.clear());
        (self.subset(|name| !held.contains(name)), held_out)
    }
}
