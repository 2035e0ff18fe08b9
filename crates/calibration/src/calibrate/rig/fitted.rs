//! A calibrated rig with everything that is known about its fit.

use crate::calibrate::Calibrated;
use depthcal_io::LeftOpen;
use nalgebra::{DMatrix, Isometry3};

use crate::adjust::state::{RigFrame, State};
use crate::observe::{PlaceDrift, PlacedCamera};
use crate::start::views::PairSummary;

/// A calibrated rig.
#[derive(Debug, Clone)]
pub struct RigCalibrated {
    /// The dataset's name.
    pub name: String,
    /// The cameras; the first is the reference.
    pub cameras: Vec<CameraFit>,
    /// All frames with the pose of the board.
    pub frames: Vec<RigFrame>,
    /// Joint covariance of the places and parameters of all cameras, in the order of [`RigCalibrated::parameters`]; zero for held
    /// parameters.
    pub covariance: DMatrix<f64>,
    /// Pairs of cameras that share views.
    pub pairs: Vec<PairSummary>,
    /// Final cost.
    pub cost: f64,
    /// Iterations of the last adjustment.
    pub iterations: usize,
    /// Why it stopped.
    pub termination: String,
    /// Final state of the last adjustment.
    pub state: State,
}

/// One camera of a calibrated rig.
#[derive(Debug, Clone)]
pub struct CameraFit {
    /// Its name.
    pub name: String,
    /// Its place: maps the rig's frame to its own, mm; the identity for the reference.
    pub camera_from_rig: Isometry3<f64>,
    /// Standard deviations of the place's tangent (ω, τ), rad and mm; zero where it is known, `None` for the reference.
    pub place_std_dev: Option<[f64; 6]>,
    /// How the place changes with time or temperature, with standard deviations of the change; `None` where it does not.
    pub drift: Option<(PlaceDrift, [f64; 6])>,
    /// By how much it exposes later than its times say; `None` where that was not asked.
    pub time_offset: Option<TimeOffset>,
    /// The camera with its own part of the fit, as if it had been calibrated alone.
    pub calibrated: Calibrated,
    /// Noise of a marker in the fit of this camera alone, px per coordinate; `None` of a camera without images.
    pub alone_px: Option<f64>,
    /// Parameters that the boards leave open.
    pub left_open: Vec<LeftOpen>,
}

/// By how much a camera exposes later than the times of its frames say, against the reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimeOffset {
    /// The offset, s.
    pub value_s: f64,
    /// Its standard deviation, s.
    pub std_dev_s: f64,
}

/// Names of the tangent of a place.
pub(crate) const PLACE: [&str; 6] = ["rx", "ry", "rz", "tx", "ty", "tz"];

impl CameraFit {
    /// Whether the board was found in any of its images.
    pub fn has_markers(&self) -> bool {
        self.calibrated.capture.frames.iter().any(|frame| !frame.markers.is_empty())
    }
}

impl RigCalibrated {
    /// `CAMERA/PIECE.PARAMETER`, `CAMERA/camera_from_rig.rx`, `CAMERA/extrinsics_drift.rx` or `CAMERA/time_offset.dt` of every
    /// row of the covariance, and whether it is free.
    pub fn parameters(&self) -> Vec<(String, bool)> {
        let mut names = Vec::new();
        for camera in &self.cameras {
            if let Some(std_dev) = camera.place_std_dev {
                let is_free = std_dev != [0.0; 6];
                names.extend(PLACE.map(|p| (format!("{}/camera_from_rig.{p}", camera.name), is_free)));
            }
            if camera.drift.is_some() {
                names.extend(PLACE.map(|p| (format!("{}/extrinsics_drift.{p}", camera.name), true)));
            }
            if camera.time_offset.is_some() {
                names.push((format!("{}/time_offset.dt", camera.name), true));
            }
            let of_camera = crate::calibrate::parameter_names(&camera.calibrated.camera);
            names.extend(of_camera.into_iter().map(|(name, free)| (format!("{}/{name}", camera.name), free)));
        }
        names
    }

    /// The cameras with their extrinsics.
    pub fn placed(&self) -> Vec<PlacedCamera> {
        self.state.placed()
    }

    /// The camera of this name.
    pub fn camera(&self, name: &str) -> Option<&CameraFit> {
        self.cameras.iter().find(|camera| camera.name == name)
    }
}
