//! The state of a calibration: cameras with their extrinsics, and frames with the board's poses.

use super::camera_prior::CameraPrior;
use super::smoothness_prior::Smoothness;
use crate::observe::noise::NoiseModel;
use crate::observe::{AdjustableFrame, CameraFrames, RawFrame, SampledFrame};
use std::ops::Range;
use std::sync::Arc;

use depthcal_io::FrameMetadata;
use depthcal_model::Camera;
use depthcal_model::chain::POSE;
use nalgebra::Isometry3;

use crate::observe::board_motion::{BoardMotion, motions};
use crate::observe::{PlaceDrift, PlacedCamera, Taken};

/// Name of a camera that is alone.
pub const REFERENCE: &str = "camera";

/// A frame of a rig: one pose of the board, whichever cameras saw it.
#[derive(Debug, Clone)]
pub struct RigFrame {
    /// Its name.
    pub name: String,
    /// Pose of the board: maps board coordinates to those of the rig, mm.
    pub rig_from_board: Isometry3<f64>,
    /// Which of several boards it is about, by number; 0 where there is one.
    pub board: usize,
    /// Its row of the dataset's table.
    pub metadata: FrameMetadata,
    /// When it was taken, and at which temperature.
    pub taken: Taken,
    /// How the board moves about it; `None` where that is unknown, or where no camera needs it.
    pub motion: Option<BoardMotion>,
}

/// A camera of a rig in the course of its calibration.
#[derive(Debug, Clone)]
pub struct CameraState<F = SampledFrame> {
    /// Its name.
    pub name: String,
    /// The camera.
    pub camera: Camera,
    /// Its place; the identity for the reference.
    pub camera_from_rig: Isometry3<f64>,
    /// Whether that is known, and held.
    pub is_placed: bool,
    /// How its place changes.
    pub drift: Option<PlaceDrift>,
    /// By how much it exposes later than its frames' times say, against the reference, s; `None` where that is not asked. Then it
    /// has frames only about which the board's motion is known.
    pub offset_s: Option<f64>,
    /// The noise that weights its residuals.
    pub noise: NoiseModel,
    /// The prior of its fields.
    pub smoothness: Smoothness,
    /// Its frames with their samples. Poses are those of the board in this camera.
    pub capture: CameraFrames<F>,
    /// For each of its frames its number among [`State::frames`].
    pub frames: Vec<usize>,
    /// Distance at which the noise of its depth pixels is uncorrelated, px.
    pub correlation_length_px: Option<usize>,
    /// Depth samples that were left out as outliers.
    pub outliers: usize,
    /// Priors of its parameters: of a camera without images.
    pub priors: Vec<ParameterPrior>,
    /// The prior of its parameters from other units, where there is one.
    pub prior: Option<Arc<CameraPrior>>,
}

/// A normal prior of one parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ParameterPrior {
    /// Number of its block among [`Camera::blocks`].
    pub block: usize,
    /// Number of the parameter in the block.
    pub component: usize,
    /// Its mean.
    pub mean: f64,
    /// Its standard deviation.
    pub sigma: f64,
}

/// Rows of a camera in the joint covariance; empty ranges for what it does not have.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CameraRows {
    /// The tangent (ω, τ) of its extrinsics.
    pub extrinsics: Range<usize>,
    /// Their drift.
    pub drift: Range<usize>,
    /// The offset of its time.
    pub offset: Range<usize>,
    /// Its parameters, in the order of [`Camera::theta`].
    pub blocks: Range<usize>,
}

/// A rig in the course of its calibration.
#[derive(Debug, Clone)]
pub struct State<F = SampledFrame> {
    /// All frames.
    pub frames: Vec<RigFrame>,
    /// The cameras; the first is the reference.
    pub cameras: Vec<CameraState<F>>,
}

impl RigFrame {
    /// By how much the time of a camera's own frame is later than the rig's, s; 0 where either is unknown.
    pub fn later_s(&self, own: &RawFrame) -> f64 {
        own.metadata.timestamp_s.zip(self.metadata.timestamp_s).map_or(0.0, |(own, of_rig)| own - of_rig)
    }
}

impl<F: AdjustableFrame> CameraState<F> {
    /// A camera that is the reference, with frames of its own and the noise that weights their residuals.
    pub fn reference(capture: CameraFrames<F>, camera: Camera, noise: NoiseModel) -> Self {
        Self {
            name: REFERENCE.to_owned(),
            camera,
            camera_from_rig: Isometry3::identity(),
            is_placed: true,
            drift: None,
            offset_s: None,
            noise,
            smoothness: Smoothness::default(),
            frames: (0..capture.frames.len()).collect(),
            capture,
            correlation_length_px: None,
            outliers: 0,
            priors: Vec::new(),
            prior: None,
        }
    }

    /// Its place in a frame.
    pub fn place_in(&self, frame: &RigFrame) -> Isometry3<f64> {
        self.drift.as_ref().map_or(self.camera_from_rig, |drift| drift.place(&self.camera_from_rig, &frame.taken))
    }

    /// Whether it has depth samples.
    pub fn has_depth(&self) -> bool {
        self.capture.frames.iter().any(|frame| !frame.samples().is_empty())
    }

    /// Whether it has markers.
    pub fn has_markers(&self) -> bool {
        self.capture.frames.iter().any(|frame| !frame.posed().markers.is_empty())
    }
}

impl<F: AdjustableFrame> State<F> {
    /// The state of one camera: a rig of one, whose frames are the camera's.
    pub fn of_camera(camera: CameraState<F>) -> Self {
        let mut state = Self { frames: Vec::new(), cameras: vec![camera] };
        state.take_frames();
        state
    }

    /// The cameras with their extrinsics.
    pub fn placed(&self) -> Vec<PlacedCamera> {
        let placed = |camera: &CameraState<F>| PlacedCamera {
            name: camera.name.clone(),
            camera: camera.camera.clone(),
            camera_from_rig: camera.camera_from_rig,
            drift: camera.drift,
        };
        self.cameras.iter().map(placed).collect()
    }

    /// Takes frames and poses from the only camera, whose frames were changed.
    pub fn take_frames(&mut self) {
        let [camera] = &mut self.cameras[..] else { return };
        camera.frames = (0..camera.capture.frames.len()).collect();
        let frame = |frame: &F| {
            let posed = frame.posed();
            RigFrame {
                name: posed.name.clone(),
                rig_from_board: posed.camera_from_board,
                board: posed.board,
                metadata: posed.metadata.clone(),
                taken: Taken::of(posed),
                motion: None,
            }
        };
        self.frames = camera.capture.frames.iter().map(frame).collect();
    }

    /// The frames, given by their numbers, for which `keep` is true, with what the cameras observed in them.
    #[must_use]
    pub fn subset(&self, keep: impl Fn(usize) -> bool) -> Self {
        let mut number = 0;
        let renumbered: Vec<Option<usize>> = (0..self.frames.len())
            .map(|i| {
                keep(i).then(|| {
                    number += 1;
                    number - 1
                })
            })
            .collect();
        let frames = self.frames.iter().zip(&renumbered).filter(|(_, n)| n.is_some()).map(|(f, _)| f.clone());
        let camera = |camera: &CameraState<F>| CameraState {
            capture: camera.capture.subset(|i, _| renumbered[camera.frames[i]].is_some()),
            frames: camera.frames.iter().filter_map(|f| renumbered[*f]).collect(),
            ..camera.clone()
        };
        Self { frames: frames.collect(), cameras: self.cameras.iter().map(camera).collect() }
    }

    /// Rows of every camera in the joint covariance of the cameras' parameters
    /// ([`Adjustment::variables`](super::adjustment::Adjustment::variables)).
    pub fn parameter_rows(&self) -> Vec<CameraRows> {
        let mut first = 0;
        let mut take = |count: usize| {
            first += count;
            first - count..first
        };
        let rows = |(number, camera): (usize, &CameraState<F>)| {
            let of_tangent = |is_there: bool| if number > 0 && is_there { POSE } else { 0 };
            CameraRows {
                extrinsics: take(of_tangent(true)),
                drift: take(of_tangent(camera.drift.is_some())),
                offset: take(usize::from(number > 0 && camera.offset_s.is_some())),
                blocks: take(camera.camera.theta().len()),
            }
        };
        self.cameras.iter().enumerate().map(rows).collect()
    }

    /// Whether any camera has markers in each of the frames.
    pub fn frames_with_markers(&self) -> Vec<bool> {
        let mut seen = vec![false; self.frames.len()];
        for camera in &self.cameras {
            for (number, frame) in camera.frames.iter().zip(&camera.capture.frames) {
                seen[*number] |= !frame.posed().markers.is_empty();
            }
        }
        seen
    }

    /// Takes the motion of the board about every frame from the present poses of those before and after, where a camera has an
    /// offset.
    pub fn take_motions(&mut self) {
        if self.cameras.iter().all(|camera| camera.offset_s.is_none()) {
            return;
        }
        let boards = self.frames.iter().map(|frame| frame.board + 1).max().unwrap_or(0);
        for board in 0..boards {
            let mut frames_of_board: Vec<&mut RigFrame> =
                self.frames.iter_mut().filter(|frame| frame.board == board).collect();
            let poses: Vec<_> = frames_of_board.iter().map(|f| (f.metadata.timestamp_s, f.rig_from_board)).collect();
            for (frame, motion) in frames_of_board.iter_mut().zip(motions(&poses)) {
                frame.motion = motion;
            }
        }
    }

    /// Gives the frames of every camera the poses that follow from the rig's.
    pub fn place_boards(&mut self) {
        for camera in &mut self.cameras {
            let rig_from_board = |(camera_frame, number): (&F, &usize)| {
                let frame = &self.frames[*number];
                let moving = camera.offset_s.zip(frame.motion);
                let board = moving.map_or(frame.rig_from_board, |(offset_s, motion)| {
                    motion.after(offset_s + frame.later_s(camera_frame.posed())).of(&frame.rig_from_board)
                });
                camera.place_in(frame) * board
            };
            let poses: Vec<Isometry3<f64>> =
                camera.capture.frames.iter().zip(&camera.frames).map(rig_from_board).collect();
            camera.capture.set_poses(&poses);
        }
    }
}
