//! What the calibration of a rig changes from round to round.

use crate::adjust::smoothness_prior::Smoothness;
use crate::observe::noise::NoiseModel;
use crate::observe::{Capture, RawFrame, SampledFrame};
use depthcal_io::FrameMetadata;
use depthcal_model::Camera;
use nalgebra::Isometry3;

use crate::observe::board_motion::{BoardMotion, motions};
use crate::observe::{PlaceDrift, Taken};

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
pub struct CameraState {
    /// Its name.
    pub name: String,
    /// The camera.
    pub camera: Camera,
    /// Its place; the identity for the reference.
    pub camera_from_rig: Isometry3<f64>,
    /// How its place changes.
    pub drift: Option<PlaceDrift>,
    /// By how much it exposes later than its frames' times say, against the reference, s; `None` where that is not asked. Then it has
    /// frames only about which the board's motion is known.
    pub offset_s: Option<f64>,
    /// The noise that weights its residuals.
    pub noise: NoiseModel,
    /// The prior of its fields.
    pub smoothness: Smoothness,
    /// Its frames with their samples. Poses are those of the board in this camera.
    pub capture: Capture<SampledFrame>,
    /// For each of its frames its number among [`RigState::frames`].
    pub frames: Vec<usize>,
    /// Distance at which the noise of its depth pixels is uncorrelated, px.
    pub correlation_length_px: Option<usize>,
    /// Depth samples that were left out as outliers.
    pub outliers: usize,
    /// Priors of its parameters: of a camera without images.
    pub priors: Vec<ParameterPrior>,
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

/// A rig in the course of its calibration.
#[derive(Debug, Clone)]
pub struct RigState {
    /// All frames.
    pub frames: Vec<RigFrame>,
    /// The cameras; the first is the reference.
    pub cameras: Vec<CameraState>,
}

impl RigFrame {
    /// By how much the time of a camera's own frame is later than the rig's, s; 0 where either is unknown.
    pub fn later_s(&self, own: &RawFrame) -> f64 {
        own.metadata.timestamp_s.zip(self.metadata.timestamp_s).map_or(0.0, |(own, of_rig)| own - of_rig)
    }
}

impl CameraState {
    /// Its place in a frame.
    pub fn place_in(&self, frame: &RigFrame) -> Isometry3<f64> {
        self.drift.as_ref().map_or(self.camera_from_rig, |drift| drift.place(&self.camera_from_rig, &frame.taken))
    }

    /// Whether it has depth samples.
    pub fn has_depth(&self) -> bool {
        self.capture.frames.iter().any(|frame| !frame.samples.is_empty())
    }

    /// Whether it has markers.
    pub fn has_markers(&self) -> bool {
        self.capture.frames.iter().any(|frame| !frame.markers.is_empty())
    }
}

impl RigState {
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
        let camera = |camera: &CameraState| CameraState {
            capture: camera.capture.subset(|i, _| renumbered[camera.frames[i]].is_some()),
            frames: camera.frames.iter().filter_map(|f| renumbered[*f]).collect(),
            ..camera.clone()
        };
        Self { frames: frames.collect(), cameras: self.cameras.iter().map(camera).collect() }
    }

    /// Takes the motion of the board about every frame from the present poses of those before and after, where a camera has an offset.
    pub fn take_motions(&mut self) {
        if self.cameras.iter().all(|camera| camera.offset_s.is_none()) {
            return;
        }
        let boards = self.frames.iter().map(|frame| frame.board + 1).max().unwrap_or(0);
        for board in 0..boards {
            let mut own: Vec<&mut RigFrame> = self.frames.iter_mut().filter(|frame| frame.board == board).collect();
            let poses: Vec<_> = own.iter().map(|f| (f.metadata.timestamp_s, f.rig_from_board)).collect();
            for (frame, motion) in own.iter_mut().zip(motions(&poses)) {
                frame.motion = motion;
            }
        }
    }

    /// Gives the frames of every camera the poses that follow from the rig's.
    pub fn place_boards(&mut self) {
        for camera in &mut self.cameras {
            let rig_from_board = |(own, number): (&SampledFrame, &usize)| {
                let frame = &self.frames[*number];
                let moving = camera.offset_s.zip(frame.motion);
                let board = moving.map_or(frame.rig_from_board, |(offset_s, motion)| {
                    motion.after(offset_s + frame.later_s(own)).of(&frame.rig_from_board)
                });
                camera.place_in(frame) * board
            };
            let poses: Vec<Isometry3<f64>> =
                camera.capture.frames.iter().zip(&camera.frames).map(rig_from_board).collect();
            camera.capture.set_poses(&poses);
        }
    }
}
