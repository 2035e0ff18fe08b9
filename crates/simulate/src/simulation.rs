//! The description of a simulation.

use crate::board::Board;
use crate::camera::CameraTruth;
use crate::defects::Defects;
use crate::effects::{Effect, GivenEffect};
use crate::error::{SimulateError, check, not_negative, positive};
use crate::kind::Kind;
use crate::light::Exposure;
use crate::noise::Noise;
use crate::pose::Pose;
use crate::rendering::Rendering;

/// A camera that captures a board.
///
/// ```
/// use depthcal_simulate::{CameraTruth, Effect, Kind, PointOptions, Simulation};
///
/// let camera = CameraTruth::published(1)?;
/// let effects = [Effect::new("range_offset", 5.0)?];
/// let points = Simulation::new(camera, Kind::General(1), &effects, 7).observe_points(&PointOptions::default())?;
/// assert_eq!(points.frames.len(), 27);
/// assert_eq!(points.frames[0].markers.len(), 44);
/// # Ok::<(), depthcal_simulate::SimulateError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Simulation {
    pub(crate) camera: CameraTruth,
    pub(crate) kind: Kind,
    pub(crate) effects: Vec<Effect>,
    pub(crate) given: Vec<GivenEffect>,
    pub(crate) seed: u64,
    /// Seed of times and temperatures, where it is another.
    pub(crate) conditions_seed: Option<u64>,
    /// Time between frames of a video, s.
    pub(crate) period_s: Option<f64>,
    pub(crate) unit: u64,
    pub(crate) frames: usize,
    pub(crate) poses: Option<Vec<Pose>>,
    pub(crate) board: Board,
    pub(crate) noise: Noise,
    pub(crate) exposure: Exposure,
    pub(crate) defects: Defects,
    pub(crate) rendering: Rendering,
}

impl Simulation {
    /// `camera` with `effects` captures the thesis' board in poses of `kind`. The seed determines poses, times and
    /// noise.
    pub fn new(camera: CameraTruth, kind: Kind, effects: &[Effect], seed: u64) -> Self {
        Self {
            camera,
            kind,
            effects: effects.to_vec(),
            given: Vec::new(),
            seed,
            conditions_seed: None,
            period_s: None,
            unit: 0,
            frames: kind.frames(),
            poses: None,
            board: Board::default(),
            noise: Noise::default(),
            exposure: Exposure::Auto { white: 0.6 },
            defects: Defects::default(),
            rendering: Rendering::default(),
        }
    }

    /// Sets the number of frames, which is otherwise the kind's.
    pub fn frames(mut self, frames: usize) -> Self {
        self.frames = frames;
        self.poses = None;
        self
    }

    /// Sets the pose of the board in every frame, instead of the kind's poses. The board may extend beyond the image.
    pub fn poses(mut self, poses: Vec<Pose>) -> Self {
        self.frames = poses.len();
        self.poses = Some(poses);
        self
    }

    /// Adds depth effects that are given as functions, after those by name.
    pub fn given(mut self, effects: impl IntoIterator<Item = GivenEffect>) -> Self {
        self.given.extend(effects);
        self
    }

    /// Sets a seed of times and temperatures alone: cameras of one rig have them in common, but noise of their own.
    pub(crate) fn conditions_seed(mut self, seed: u64) -> Self {
        self.conditions_seed = Some(seed);
        self
    }

    /// Makes the frames those of a video, so many seconds apart.
    pub(crate) fn video(mut self, period_s: Option<f64>) -> Self {
        self.period_s = period_s;
        self
    }

    /// Sets the board.
    pub fn board(mut self, board: Board) -> Self {
        self.board = board;
        self
    }

    /// Sets the noise.
    pub fn noise(mut self, noise: Noise) -> Self {
        self.noise = noise;
        self
    }

    /// Sets the exposure.
    pub fn exposure(mut self, exposure: Exposure) -> Self {
        self.exposure = exposure;
        self
    }

    /// Sets the defects of the capture.
    pub fn defects(mut self, defects: Defects) -> Self {
        self.defects = defects;
        self
    }

    /// Sets the options of rendering: bits, depth unit, background, missing depth.
    pub fn rendering(mut self, rendering: Rendering) -> Self {
        self.rendering = rendering;
        self
    }

    /// Sets the number of the individual camera. Unit 0 has its effects in their nominal shape; every other unit has
    /// periods, phases, directions and proportions of its own, but effects of the same size. Captures of one unit share
    /// its effects for any seed and kind.
    pub fn unit(mut self, unit: u64) -> Self {
        self.unit = unit;
        self
    }

    pub(crate) fn check(&self) -> Result<(), SimulateError> {
        self.camera.check()?;
        self.noise.check()?;
        self.defects.check(self.frames)?;
        let board = &self.board;
        positive([
            ("frames", self.frames as f64),
            ("board.columns", board.columns as f64),
            ("board.rows", board.rows as f64),
            ("board.spacing_mm", board.spacing_mm),
            ("board.circle_diameter_mm", board.circle_diameter_mm().unwrap_or(1.0)),
            ("board.bright", board.bright),
            ("board.dark", board.dark),
        ])?;
        let numbers = |pose: &Pose| pose.rotation.into_iter().flatten().chain(pose.translation);
        let poses = self.poses.iter().flatten().flat_map(numbers);
        check(poses.map(|value| ("poses", value)), "finite numbers", |_| true)?;
        not_negative([("board.card_margin_mm", board.card_margin_mm)])
    }
}
