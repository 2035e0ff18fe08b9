//! Calibrated cameras with everything that is known about their fit.

use depthcal_io::LeftOpen;
use depthcal_model::chain::POSE;
use nalgebra::{DMatrix, Isometry3};

use super::calibrated_camera::CalibratedCamera;
use super::parameter_names::parameter_names;
use crate::adjust::state::{CameraState, RigFrame, State};
use crate::observe::{CameraCapture, CameraFrames, Capture, PlaceDrift, PlacedCamera, PosedFrame};
use crate::start::views::PairSummary;

/// The calibrated cameras of a capture, of which there is at least one.
#[derive(Debug, Clone)]
pub struct Calibrated {
    /// The dataset's name.
    pub name: String,
    /// The cameras; the first is the reference.
    pub cameras: Vec<CameraFit>,
    /// All frames with the pose of the board.
    pub frames: Vec<RigFrame>,
    /// Joint covariance of the extrinsics and parameters of all cameras, in the order of [`Calibrated::parameters`]; zero for
    /// held parameters. `None` from the estimators that give none.
    pub covariance: Option<DMatrix<f64>>,
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

/// One calibrated camera with its extrinsics.
#[derive(Debug, Clone)]
pub struct CameraFit {
    /// Its name.
    pub name: String,
    /// Its place: maps the rig's frame to its own, mm; the identity for the reference.
    pub camera_from_rig: Isometry3<f64>,
    /// Standard deviations of the place's tangent (ω, τ), rad and mm; zero where it is known, NaN where the covariance is out of
    /// reach, `None` for the reference.
    pub place_std_dev: Option<[f64; 6]>,
    /// How the place changes with time or temperature, with standard deviations of the change; `None` where it does not.
    pub drift: Option<(PlaceDrift, [f64; 6])>,
    /// By how much it exposes later than its times say; `None` where that was not asked.
    pub time_offset: Option<TimeOffset>,
    /// The camera with its own part of the fit, as if it had been calibrated alone.
    pub calibrated: CalibratedCamera,
    /// The evidence of its images alone; `None` of a camera without images, and of one that is alone.
    pub alone: Option<ImagesAlone>,
    /// Parameters that the boards leave open.
    pub left_open: Vec<LeftOpen>,
}

/// The evidence of the images of one camera of several without the others, against which the joint fit is held.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImagesAlone {
    /// Noise of a marker, px per coordinate.
    pub noise_px: f64,
    /// The focal length fx and its standard deviation, px; `None` where it is held.
    pub focal_px: Option<[f64; 2]>,
}

impl ImagesAlone {
    /// Of a fit to the images of one camera.
    pub(super) fn of(from_image: &CalibratedCamera<PosedFrame>) -> Self {
        Self { noise_px: from_image.noise.pixel_sigma, focal_px: from_image.focal_length() }
    }
}

/// By how much a camera exposes later than the times of its frames say, against the reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimeOffset {
    /// The offset, s.
    pub value_s: f64,
    /// Its standard deviation, s; NaN where the covariance is out of reach.
    pub std_dev_s: f64,
}

/// Names of the tangent of a place.
pub(crate) const PLACE: [&str; POSE] = ["rx", "ry", "rz", "tx", "ty", "tz"];

impl CameraFit {
    /// Whether the board was found in any of its images.
    pub fn has_markers(&self) -> bool {
        self.calibrated.capture.frames.iter().any(|frame| !frame.markers.is_empty())
    }
}

impl Calibrated {
    /// The fit of a camera that is alone: the reference.
    pub fn of_camera(name: &str, calibrated: CalibratedCamera) -> Self {
        let CalibratedCamera { capture, camera, covariance, noise, cost, iterations, termination, .. } = &calibrated;
        let state = State::of_camera(CameraState {
            name: name.to_owned(),
            smoothness: calibrated.smoothness.clone(),
            correlation_length_px: calibrated.correlation_length_px,
            outliers: calibrated.outliers,
            prior: calibrated.prior.clone(),
            ..CameraState::reference(capture.clone(), camera.clone(), *noise)
        });
        Self {
            name: capture.name.clone(),
            frames: state.frames.clone(),
            covariance: covariance.clone(),
            pairs: Vec::new(),
            cost: *cost,
            iterations: *iterations,
            termination: termination.clone(),
            state,
            cameras: vec![CameraFit {
                name: name.to_owned(),
                camera_from_rig: Isometry3::identity(),
                place_std_dev: None,
                drift: None,
                time_offset: None,
                calibrated,
                alone: None,
                left_open: Vec::new(),
            }],
        }
    }

    /// `PIECE.PARAMETER` of every row of the covariance, and whether it is free; of several cameras `CAMERA/PIECE.PARAMETER`,
    /// `CAMERA/camera_from_rig.rx`, `CAMERA/extrinsics_drift.rx` and `CAMERA/time_offset.dt`.
    pub fn parameters(&self) -> Vec<(String, bool)> {
        if let [only] = &self.cameras[..] {
            return parameter_names(&only.calibrated.camera);
        }
        let mut names = Vec::new();
        for camera in &self.cameras {
            if let Some(std_dev) = camera.place_std_dev {
                let is_free = std_dev != [0.0; POSE];
                names.extend(PLACE.map(|p| (format!("{}/camera_from_rig.{p}", camera.name), is_free)));
            }
            if camera.drift.is_some() {
                names.extend(PLACE.map(|p| (format!("{}/extrinsics_drift.{p}", camera.name), true)));
            }
            if camera.time_offset.is_some() {
                names.push((format!("{}/time_offset.dt", camera.name), true));
            }
            let of_camera = parameter_names(&camera.calibrated.camera);
            names.extend(of_camera.into_iter().map(|(name, free)| (format!("{}/{name}", camera.name), free)));
        }
        names
    }

    /// Standard deviation of a row of [`parameters`](Self::parameters); zero where it is held, NaN without a covariance.
    pub fn std_dev(&self, row: usize) -> f64 {
        self.covariance.as_ref().map_or(f64::NAN, |covariance| covariance[(row, row)].max(0.0).sqrt())
    }

    /// The cameras with their extrinsics.
    pub fn placed(&self) -> Vec<PlacedCamera> {
        self.state.placed()
    }

    /// The camera of this name.
    pub fn camera(&self, name: &str) -> Option<&CameraFit> {
        self.cameras.iter().find(|camera| camera.name == name)
    }

    /// The camera whose frame is the rig's: the first.
    pub fn reference(&self) -> &CameraFit {
        &self.cameras[0]
    }

    /// The only camera; `None` of several.
    pub fn only_camera(&self) -> Option<&CalibratedCamera> {
        match &self.cameras[..] {
            [only] => Some(&only.calibrated),
            _ => None,
        }
    }

    /// The frames that were fitted, as they were detected.
    pub fn capture(&self) -> Capture {
        let camera =
            |camera: &CameraFit| CameraCapture::of(&camera.name, CameraFrames::detected(&camera.calibrated.capture));
        Capture { name: self.name.clone(), cameras: self.cameras.iter().map(camera).collect() }
    }
}
