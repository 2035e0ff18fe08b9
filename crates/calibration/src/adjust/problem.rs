//! The parts of an adjustment: frames with poses of the board, and what every camera observed in them.

use depthcal_model::Camera;
use nalgebra::Isometry3;

use super::state::{CameraState, State};
use crate::observe::board_motion::BoardMotion;
use crate::observe::noise::NoiseModel;
use crate::observe::{AdjustableFrame, CameraFrames};

/// An adjustment's observations and start values. One camera is a rig of one: its frame is the rig's.
pub struct Problem<'a, F> {
    /// Name of every frame, and the pose `rig_from_board` from which the adjustment starts, mm.
    pub frames: Vec<(&'a str, Isometry3<f64>)>,
    /// The cameras; the first is the reference.
    pub cameras: Vec<CameraProblem<'a, F>>,
}

/// One camera's part of an adjustment.
pub struct CameraProblem<'a, F> {
    /// Its name, where there are others: labels of variables begin with it.
    pub name: Option<&'a str>,
    /// The camera at its start values.
    pub camera: &'a Camera,
    /// The noise that weights its residuals.
    pub noise: &'a NoiseModel,
    /// Its frames with their observations.
    pub capture: &'a CameraFrames<F>,
    /// Its frames among those of the problem, in the order of its capture.
    pub views: Vec<View>,
    /// Whether its depth samples take part; without them its pieces of depth are held.
    pub with_depth: bool,
    /// Its extrinsics; `None` for the reference.
    pub extrinsics: Option<Extrinsics>,
}

/// A frame of a camera among those of the problem.
#[derive(Debug, Clone, Copy)]
pub struct View {
    /// Its number.
    pub frame: usize,
    /// How far the camera's extrinsics have drifted in it, in units of their drift.
    pub drifted: f64,
    /// How the board moves about the frame, and by how much the camera's time is later than the frame's, s.
    pub moving: Option<(BoardMotion, f64)>,
}

/// Start values of a camera's extrinsics.
#[derive(Debug, Clone, Copy)]
pub struct Extrinsics {
    /// Maps the rig's frame to the camera's, mm.
    pub camera_from_rig: Isometry3<f64>,
    /// Whether they are known, and held.
    pub are_known: bool,
    /// Their change with time or temperature, ω and τ; `None` where they do not change.
    pub drift: Option<[f64; 6]>,
    /// By how much the camera exposes later than its times say, s; `None` where that is not estimated.
    pub offset_s: Option<f64>,
}

impl<'a, F: AdjustableFrame> Problem<'a, F> {
    /// The problem of one camera with the poses of its frames; depth samples take part where `with_depth`.
    pub fn of_camera(
        capture: &'a CameraFrames<F>,
        camera: &'a Camera,
        noise: &'a NoiseModel,
        with_depth: bool,
    ) -> Self {
        let frames = capture.frames.iter().map(|f| (f.posed().name.as_str(), f.posed().camera_from_board)).collect();
        let views = (0..capture.frames.len()).map(|frame| View { frame, drifted: 0.0, moving: None }).collect();
        let camera = CameraProblem { name: None, camera, noise, capture, views, with_depth, extrinsics: None };
        Self { frames, cameras: vec![camera] }
    }

    /// The problem of all cameras of a state, each with depth where it has samples and `with_depth`.
    pub fn of_state(state: &'a State<F>, with_depth: bool) -> Self {
        let frames = state.frames.iter().map(|f| (f.name.as_str(), f.rig_from_board)).collect();
        let camera = |(number, camera): (usize, &'a CameraState<F>)| {
            let view = |(camera_frame, frame): (&F, &usize)| {
                let rig_frame = &state.frames[*frame];
                let later_s = || rig_frame.later_s(camera_frame.posed());
                View {
                    frame: *frame,
                    drifted: camera.drift.as_ref().map_or(0.0, |drift| drift.share(&rig_frame.taken)),
                    moving: camera.offset_s.and(rig_frame.motion).map(|motion| (motion, later_s())),
                }
            };
            let extrinsics = Extrinsics {
                camera_from_rig: camera.camera_from_rig,
                are_known: camera.is_placed,
                drift: camera.drift.map(|drift| drift.change),
                offset_s: camera.offset_s,
            };
            CameraProblem {
                name: (state.cameras.len() > 1).then_some(camera.name.as_str()),
                camera: &camera.camera,
                noise: &camera.noise,
                capture: &camera.capture,
                views: camera.capture.frames.iter().zip(&camera.frames).map(view).collect(),
                with_depth: with_depth && camera.has_depth(),
                extrinsics: (number > 0).then_some(extrinsics),
            }
        };
        Self { frames, cameras: state.cameras.iter().enumerate().map(camera).collect() }
    }
}
