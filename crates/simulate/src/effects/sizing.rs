//! The measurement of an effect's size over pixels and depths, and the random shape of an individual camera's effects.

use std::cell::RefCell;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::board::Board;
use crate::camera::CameraTruth;
use crate::conditions::{Conditions, REFERENCE_TEMPERATURE_C};
use crate::instrument::{DepthEffect, Reading};
use crate::optics::Optics;
use crate::streams::{Purpose, seed_with_name, stream};

/// The camera and board in which an effect is installed.
pub(crate) struct Context<'a> {
    pub camera: &'a CameraTruth,
    pub board: &'a Board,
    /// Seed of the capture, for properties that change between captures.
    pub seed: u64,
    name: &'static str,
    unit: u64,
    shape: RefCell<Option<ChaCha8Rng>>,
}

impl<'a> Context<'a> {
    pub fn new(camera: &'a CameraTruth, board: &'a Board, name: &'static str, unit: u64, seed: u64) -> Self {
        let shape = (unit != 0).then(|| stream(seed_with_name(unit, name), Purpose::EffectShape, 0));
        Self { camera, board, seed, name, unit, shape: RefCell::new(shape) }
    }

    /// A property of the effect: `nominal` for unit 0, otherwise drawn uniformly within ± `spread` of it.
    pub fn near(&self, nominal: f64, spread: f64) -> f64 {
        match self.shape.borrow_mut().as_mut() {
            Some(rng) => nominal + spread * rng.random_range(-1.0..1.0),
            None => nominal,
        }
    }

    /// A stream of random numbers of the individual camera, for effects whose whole shape is random.
    pub fn unit_stream(&self) -> ChaCha8Rng {
        stream(seed_with_name(self.unit, self.name), Purpose::EffectShape, 1)
    }

    /// Root mean square of a depth effect over the reference volume under `conditions`, mm.
    pub fn rms_mm(&self, effect: &dyn DepthEffect, conditions: Conditions) -> f64 {
        let mut sum = 0.0;
        let mut count = 0.0;
        for reading in self.reference_rays(conditions) {
            for step in 0..17 {
                let z = 400.0 + 50.0 * f64::from(step);
                // Trapezoidal weights.
                let weight = if step == 0 || step == 16 { 0.5 } else { 1.0 };
                sum += weight * (1.0 / effect.distort(&reading, 1.0 / z) - z).powi(2);
                count += weight;
            }
        }
        if count > 0.0 { f64::sqrt(sum / count) } else { 0.0 }
    }

    /// Readings at a grid of pixels over the whole image.
    pub fn reference_rays(&self, conditions: Conditions) -> Vec<Reading> {
        let optics = Optics::new(self.camera);
        self.pixel_grid()
            .into_iter()
            .filter_map(|pixel| {
                let ray = optics.ray(pixel, 0.001)?;
                let cosine = 1.0 / (1.0 + ray[0] * ray[0] + ray[1] * ray[1]).sqrt();
                Some(Reading { pixel, ray, cosine, amplitude: 0.5, conditions })
            })
            .collect()
    }

    /// Centres of 32 × 24 equal cells of the image.
    pub fn pixel_grid(&self) -> Vec<[f64; 2]> {
        let (width, height) = (self.camera.width as f64, self.camera.height as f64);
        let centre = |i: usize, n: usize, size: f64| (i as f64 + 0.5) / n as f64 * size - 0.5;
        (0..24).flat_map(|i| (0..32).map(move |j| [centre(j, 32, width), centre(i, 24, height)])).collect()
    }

    /// Root mean square displacement of the image by a change of the optics, over rays of the whole image, px.
    pub fn rms_px(&self, before: &Optics, after: &Optics) -> f64 {
        let shifts: Vec<f64> = self
            .pixel_grid()
            .into_iter()
            .filter_map(|pixel| {
                let [x, y] = before.ray(pixel, 0.001)?;
                let moved = after.project([x * 1000.0, y * 1000.0, 1000.0])?;
                Some((moved[0] - pixel[0]).powi(2) + (moved[1] - pixel[1]).powi(2))
            })
            .collect();
        (shifts.iter().sum::<f64>() / shifts.len().max(1) as f64).sqrt()
    }
}

/// The middle of a session at the reference temperature.
pub(crate) fn usual() -> Conditions {
    Conditions { frame: 0, time_s: 50.0, session_s: 100.0, temperature_c: REFERENCE_TEMPERATURE_C }
}
