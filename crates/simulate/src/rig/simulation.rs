//! The description of a simulated rig.

use super::camera::RigCamera;
use super::truth::{RigCameraTruth, RigPoints, RigTruth};
use super::waved::Waved;
use crate::board::Board;
use crate::conditions;
use crate::effects::Effect;
use crate::error::SimulateError;
use crate::kind::Kind;
use crate::points::PointOptions;
use crate::pose::{Pose, choose};
use crate::simulation::Simulation;
use crate::streams::seed_with_name;

/// Cameras on one rigid body that capture a board at the same moments. Poses are chosen for the first camera; others may see a
/// part of the board only, or none of it.
#[derive(Debug, Clone)]
pub struct RigSimulation {
    pub(super) cameras: Vec<RigCamera>,
    pub(super) kind: Kind,
    pub(super) seed: u64,
    frames: usize,
    poses: Option<Vec<Pose>>,
    waved: Option<Waved>,
    board: Board,
    board_effects: Vec<Effect>,
}

impl RigSimulation {
    /// A rig of `cameras`, the first of which is the reference: its place is not used.
    pub fn new(cameras: Vec<RigCamera>, kind: Kind, seed: u64) -> Self {
        let frames = kind.frames();
        Self {
            cameras,
            kind,
            seed,
            frames,
            poses: None,
            waved: None,
            board: Board::default(),
            board_effects: Vec::new(),
        }
    }

    /// Sets the number of frames, which is otherwise the kind's.
    #[must_use]
    pub fn frames(mut self, frames: usize) -> Self {
        self.frames = frames;
        self
    }

    /// Sets the pose of the board in the rig's frame in every frame, instead of the kind's poses.
    #[must_use]
    pub fn poses(mut self, rig_from_board: Vec<Pose>) -> Self {
        self.frames = rig_from_board.len();
        self.poses = Some(rig_from_board);
        self
    }

    /// Waves the board while the cameras take a video of so many frames, instead of the kind's poses.
    #[must_use]
    pub fn waved(mut self, waved: Waved, frames: usize) -> Self {
        self.frames = frames;
        self.waved = Some(waved);
        self
    }

    /// Sets the board.
    #[must_use]
    pub fn board(mut self, board: Board) -> Self {
        self.board = board;
        self
    }

    /// Adds an error of the board, which all cameras see.
    #[must_use]
    pub fn board_effect(mut self, effect: Effect) -> Self {
        self.board_effects.push(effect);
        self
    }

    /// The poses of the board in the rig's frame.
    ///
    /// # Errors
    /// [`SimulateError`] when the board does not fit into the first camera's images.
    pub fn rig_from_board(&self) -> Result<Vec<Pose>, SimulateError> {
        if let Some(waved) = &self.waved {
            return Ok((0..self.frames).map(|i| waved.pose(&self.board, waved.period_s * i as f64)).collect());
        }
        match (&self.poses, self.cameras.first()) {
            (Some(poses), _) => Ok(poses.clone()),
            (None, Some(first)) => choose(&first.camera, &self.board, self.kind, self.frames, self.seed),
            (None, None) => Ok(Vec::new()),
        }
    }

    /// Every camera as a simulation of its own, with the poses of the board in its frame.
    pub(super) fn simulations(&self) -> Result<Vec<Simulation>, SimulateError> {
        let rig_from_board = self.rig_from_board()?;
        let conditions = match &self.waved {
            Some(waved) => conditions::video(self.frames, waved.period_s),
            None => conditions::choose(self.frames, seed_with_name(self.seed, &self.kind.to_string())),
        };
        let simulation = |(number, camera): (usize, &RigCamera)| {
            let place = |frame: usize| {
                let camera_from_rig = if number == 0 { Pose::identity() } else { camera.camera_from_rig };
                camera.drift.map_or(camera_from_rig, |drift| drift.apply(&camera_from_rig, &conditions[frame]))
            };
            let seen = |frame: usize| match &self.waved {
                Some(waved) => waved.pose(&self.board, conditions[frame].time_s + camera.time_offset_s),
                None => rig_from_board[frame],
            };
            let poses = (0..rig_from_board.len()).map(|frame| place(frame).after(&seen(frame))).collect();
            let effects: Vec<Effect> = self.board_effects.iter().chain(&camera.effects).cloned().collect();
            // Noise is each camera's own.
            let seed = if number == 0 { self.seed } else { seed_with_name(self.seed, &camera.name) };
            Simulation::new(camera.camera, self.kind, &effects, seed)
                .poses(poses)
                .board(self.board)
                .noise(camera.noise)
                .exposure(camera.exposure)
                .conditions_seed(self.seed)
                .video(self.waved.map(|waved| waved.period_s))
        };
        Ok(self.cameras.iter().enumerate().map(simulation).collect())
    }

    pub(super) fn truth_of(&self, truths: Vec<crate::truth::Truth>) -> RigTruth {
        let camera = |((number, camera), truth): ((usize, &RigCamera), _)| RigCameraTruth {
            name: camera.name.clone(),
            streams: camera.streams,
            camera_from_rig: if number == 0 { Pose::identity() } else { camera.camera_from_rig },
            drift: camera.drift,
            time_offset_s: camera.time_offset_s,
            truth,
        };
        RigTruth { cameras: self.cameras.iter().enumerate().zip(truths).map(camera).collect() }
    }

    /// The truth of this simulation.
    ///
    /// # Errors
    /// [`SimulateError`] when a parameter is unusable.
    pub fn truth(&self) -> Result<RigTruth, SimulateError> {
        let truths = self.simulations()?.iter().map(Simulation::truth).collect::<Result<_, _>>()?;
        Ok(self.truth_of(truths))
    }

    /// Markers and depth samples of every camera with white noise, without rendering. Cameras without images have no markers,
    /// cameras without depth no samples.
    ///
    /// # Errors
    /// [`SimulateError`] when a parameter is unusable.
    pub fn observe_points(&self, options: &PointOptions) -> Result<RigPoints, SimulateError> {
        let observed = self.simulations()?.iter().map(|s| s.observe_points(options)).collect::<Result<Vec<_>, _>>()?;
        let truth = self.truth_of(observed.iter().map(|o| o.truth.clone()).collect());
        let mut cameras = observed;
        for (camera, points) in self.cameras.iter().zip(&mut cameras) {
            for frame in &mut points.frames {
                if !camera.streams.has_image() {
                    frame.markers.clear();
                }
                if !camera.streams.has_depth() {
                    frame.depths.clear();
                }
            }
        }
        Ok(RigPoints { truth, cameras })
    }
}
