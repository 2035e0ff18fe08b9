//! Observations of the cameras of a rig.

use crate::observe::Capture;
use depthcal_model::Camera;
use nalgebra::Isometry3;

/// The captures of all cameras of a rig. Frames of different cameras that were taken together have the same name.
#[derive(Debug, Clone)]
pub struct RigCapture {
    /// The dataset's name.
    pub name: String,
    /// The cameras; the first is the reference.
    pub cameras: Vec<CameraCapture>,
}

/// Observations of one camera of a rig.
#[derive(Debug, Clone)]
pub struct CameraCapture {
    /// The camera's name.
    pub name: String,
    /// Its frames. Those of a camera without images have no markers.
    pub capture: Capture,
    /// A camera to start from or, where its parameters are held, to keep.
    pub declared: Option<Camera>,
    /// The lens model that the dataset declares.
    pub lens: Option<String>,
    /// Its extrinsics where they are known: no fit changes them.
    pub camera_from_rig: Option<Isometry3<f64>>,
}

impl CameraCapture {
    /// Whether it has images in which the board was found.
    pub fn has_markers(&self) -> bool {
        self.capture.frames.iter().any(|frame| !frame.markers.is_empty())
    }
}

impl RigCapture {
    /// Names of all frames, in the order in which cameras have them: those of the first camera first.
    pub fn frame_names(&self) -> Vec<String> {
        let mut names: Vec<String> = Vec::new();
        let mut known = std::collections::BTreeSet::new();
        for frame in self.cameras.iter().flat_map(|camera| &camera.capture.frames) {
            if known.insert(frame.name.clone()) {
                names.push(frame.name.clone());
            }
        }
        names
    }

    /// This rig with only those frames for which `keep`, given the name, is true.
    #[must_use]
    pub fn subset(&self, keep: impl Fn(&str) -> bool) -> Self {
        let camera = |camera: &CameraCapture| CameraCapture {
            capture: camera.capture.subset(|_, frame| keep(&frame.name)),
            ..camera.clone()
        };
        Self { name: self.name.clone(), cameras: self.cameras.iter().map(camera).collect() }
    }
}
