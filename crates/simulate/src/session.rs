//! A simulation prepared for observation: the camera with its effects, the frames with their poses.

use crate::defects::{Frame, Shot};
use crate::effects::{self, EffectTruth};
use crate::error::SimulateError;
use crate::instrument::{Instrument, Reading};
use crate::light::Light;
use crate::scene::{Cut, PlacedBoard};
use crate::simulation::Simulation;
use crate::truth::{FrameTruth, Truth};
use crate::{conditions, pose};

/// A simulation prepared for observation.
pub(crate) struct Session<'a> {
    pub simulation: &'a Simulation,
    pub instrument: Instrument,
    pub frames: Vec<Frame>,
    pub truth: Truth,
}

/// The depth measured by one pixel, without noise.
#[derive(Debug, Clone, Copy)]
pub(crate) struct DepthPoint {
    /// Measured inverse depth, 1/mm.
    pub rho: f64,
    /// Intersection of the pixel's ray with the board.
    pub cut: Cut,
    /// Infrared signal, share of full scale.
    pub amplitude: f64,
}

impl<'a> Session<'a> {
    pub fn new(simulation: &'a Simulation) -> Result<Self, SimulateError> {
        simulation.check()?;
        let Simulation { camera, board, kind, seed, unit, noise, defects, .. } = *simulation;
        let (mut instrument, mut effects) = effects::install(&camera, &board, &simulation.effects, unit, seed)?;
        for given in &simulation.given {
            instrument.add(Box::new(given.clone()));
            effects.push(EffectTruth::of_given(given));
        }
        let poses = match &simulation.poses {
            Some(poses) => poses.clone(),
            None => pose::choose(&camera, &board, kind, simulation.frames, seed)?,
        };
        let of_conditions = simulation.conditions_seed.unwrap_or(seed);
        let of_conditions = crate::streams::seed_with_name(of_conditions, &kind.to_string());
        let conditions = match simulation.period_s {
            Some(period_s) => conditions::video(simulation.frames, period_s),
            None => conditions::choose(simulation.frames, of_conditions),
        };
        let (frames, defective) = defects.frames(&poses, &conditions, &board, seed);
        let frame_truth = |(i, frame): (usize, &Frame)| FrameTruth {
            name: frame_name(i),
            pose: frame.image.pose,
            depth_pose: frame.depth.pose,
            conditions: frame.declared,
        };
        let truth = Truth {
            camera,
            board,
            declared_spacing_mm: board.spacing_mm * defects.spacing_factor,
            kind,
            seed,
            unit,
            effects,
            noise,
            frames: frames.iter().enumerate().map(frame_truth).collect(),
            defects,
            defective,
        };
        Ok(Self { simulation, instrument, frames, truth })
    }

    /// Seed of everything that differs between datasets.
    pub fn seed(&self) -> u64 {
        crate::streams::seed_with_name(self.simulation.seed, &self.simulation.kind.to_string())
    }

    /// The board in the pose of one exposure.
    pub fn placed(&self, shot: &Shot) -> PlacedBoard<'_> {
        PlacedBoard::new(&self.simulation.board, &self.instrument.shape, shot.pose)
    }

    /// Light of one exposure.
    pub fn light(&self, shot: &Shot) -> Light {
        let board = &self.simulation.board;
        let [cx, cy] = board.centre();
        Light::new(self.simulation.exposure, board.bright, shot.pose.apply([cx, cy, 0.0]))
    }

    /// The ray (x, y, 1) of `pixel` (px, of the image) and its intersection with the board; `None` when it misses the
    /// board.
    pub fn look(&self, placed: &PlacedBoard<'_>, pixel: [f64; 2]) -> Option<([f64; 2], Cut)> {
        let optics = &self.instrument.optics;
        let mut rho = 1.0 / placed.pose.translation[2];
        let mut nearest = None;
        // With focus breathing the ray depends on its own depth.
        let rounds = if optics.breathing_mm == 0.0 { 1 } else { 8 };
        for _ in 0..rounds {
            let ray = optics.ray(pixel, rho)?;
            let cut = placed.cut(ray)?;
            rho = 1.0 / cut.z;
            nearest = Some((ray, cut));
        }
        nearest
    }

    /// The measurement of the depth pixel `pixel` (px) on the board; where `on_paper`, as if nothing were printed
    /// there.
    pub fn depth_point(
        &self,
        placed: &PlacedBoard<'_>,
        light: &Light,
        shot: &Shot,
        pixel: [f64; 2],
        on_paper: bool,
    ) -> Option<DepthPoint> {
        let board = &self.simulation.board;
        let (ray, cut) = self.look(placed, self.instrument.image_pixel(pixel))?;
        let paper = if board.white_on_black { board.dark } else { board.bright };
        let albedo = if on_paper { paper } else { board.surface(cut.design).albedo };
        let amplitude = light.signal(albedo, cut.cosine, ray, cut.z).min(1.0);
        let reading = Reading { pixel, ray, cosine: cut.cosine, amplitude, conditions: shot.conditions };
        Some(DepthPoint { rho: self.instrument.measure(&reading, 1.0 / cut.z), cut, amplitude })
    }
}

impl Simulation {
    /// The truth of this simulation: camera, board, effects, poses, conditions and defects.
    ///
    /// # Errors
    /// [`SimulateError`] when a parameter is unusable.
    pub fn truth(&self) -> Result<Truth, SimulateError> {
        Session::new(self).map(|session| session.truth)
    }
}

/// Stem of the files of frame `index`.
pub(crate) fn frame_name(index: usize) -> String {
    format!("{index:04}")
}
