//! Effects planted in measured depth images: captures of a real camera with an additional error of known size.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::board::Board;
use crate::camera::CameraTruth;
use crate::conditions::Conditions;
use crate::effects::{self, Effect, EffectTruth};
use crate::error::{SimulateError, check};
use crate::instrument::{Instrument, Reading};
use crate::streams::{Purpose, stream};

/// A measured depth image's geometry and conditions.
#[derive(Debug, Clone, Copy)]
pub struct PlantView<'a> {
    /// Width, px.
    pub width: usize,
    /// Height, px.
    pub height: usize,
    /// Millimetres per step.
    pub unit_mm: f64,
    /// Focal lengths [fx, fy], px. Lens distortion is left out: effects vary slowly over the image.
    pub focal_px: [f64; 2],
    /// Principal point [cx, cy], px.
    pub centre_px: [f64; 2],
    /// Index, time and temperature of the frame.
    pub conditions: Conditions,
    /// Infrared signal of every pixel, share of full scale, row-major; required by `reflectivity_bias`.
    pub amplitude: Option<&'a [f32]>,
    /// Number of the individual camera, which determines the effect's shape (see
    /// [`Simulation::unit`](crate::Simulation::unit)); the same for all images of a capture.
    pub unit: u64,
    /// Seed of random numbers; the same for all images of a capture.
    pub seed: u64,
}

/// Plants `effect` in the depth image `depth_raw` (row-major, 0 = no measurement) and returns its parameters. Depth is
/// rounded to whole steps at random, upwards with a probability equal to its fraction of a step, so that effects
/// smaller than a step are right on average.
///
/// `depth_registration` displaces the depth image, interpolating between valid neighbours; effects of the hook `depth`
/// change the measured depth.
///
/// # Errors
/// [`SimulateError::NotPlantable`] for effects on board and lens, for `incidence_bias` (the image does not contain the
/// surface's inclination), and for `reflectivity_bias` without an amplitude; [`SimulateError::SizeMismatch`],
/// [`SimulateError::UnknownEffect`], [`SimulateError::BadParameter`].
pub fn plant(effect: &Effect, depth_raw: &mut [u16], view: &PlantView<'_>) -> Result<EffectTruth, SimulateError> {
    let info = effect.info()?;
    let reason = match (info.name, info.hook) {
        (_, "board") => Some("it changes the board in the scene, not the measurement"),
        (_, "lens") => Some("the lens acts on the image as well"),
        ("incidence_bias", _) => Some("the image does not contain the inclination of the surface"),
        ("reflectivity_bias", _) if view.amplitude.is_none() => {
            Some("it needs the infrared amplitude; give PlantView::amplitude")
        }
        _ => None,
    };
    if let Some(reason) = reason {
        return Err(SimulateError::NotPlantable { name: info.name, reason });
    }
    view.check(depth_raw.len())?;
    let camera = view.camera();
    let (instrument, mut truths) =
        effects::install(&camera, &Board::default(), std::slice::from_ref(effect), view.unit, view.seed)?;
    let mut rounding =
        Rounding { rng: stream(view.seed, Purpose::Planting, view.conditions.frame), unit_mm: view.unit_mm };
    if instrument.registration != [0.0, 0.0] {
        view.displace(&instrument, depth_raw, &mut rounding);
    } else {
        view.distort(&instrument, depth_raw, &mut rounding);
    }
    // One effect was installed, so there is one truth.
    truths.pop().ok_or(SimulateError::NotPlantable { name: info.name, reason: "nothing was installed" })
}

/// Stochastic rounding to whole steps.
struct Rounding {
    rng: ChaCha8Rng,
    unit_mm: f64,
}

impl Rounding {
    fn raw(&mut self, z: f64) -> u16 {
        let step = (z / self.unit_mm + self.rng.random::<f64>()).floor();
        if step >= 1.0 && step <= f64::from(u16::MAX) { step as u16 } else { 0 }
    }
}

impl PlantView<'_> {
    fn check(&self, depth_len: usize) -> Result<(), SimulateError> {
        let (width, height) = (self.width, self.height);
        let need = width * height;
        let mismatch = |what, got| Err(SimulateError::SizeMismatch { what, got, need, width, height });
        if depth_len != need {
            return mismatch("the depth image", depth_len);
        }
        match self.amplitude {
            Some(amplitude) if amplitude.len() != need => return mismatch("the amplitude image", amplitude.len()),
            _ => {}
        }
        check([("unit_mm", self.unit_mm)], "millimetres per step, positive", |value| value > 0.0)?;
        self.camera().check()
    }

    fn camera(&self) -> CameraTruth {
        let ideal = CameraTruth::ideal(self.width, self.height, self.focal_px[0]);
        CameraTruth { focal_px: self.focal_px, centre_px: self.centre_px, ..ideal }
    }

    fn distort(&self, instrument: &Instrument, depth_raw: &mut [u16], rounding: &mut Rounding) {
        for (index, raw) in depth_raw.iter_mut().enumerate().filter(|(_, raw)| **raw != 0) {
            let pixel = [(index % self.width) as f64, (index / self.width) as f64];
            let ray = [0, 1].map(|axis| (pixel[axis] - self.centre_px[axis]) / self.focal_px[axis]);
            let cosine = 1.0 / (1.0 + ray[0] * ray[0] + ray[1] * ray[1]).sqrt();
            let amplitude = self.amplitude.map_or(0.5, |amplitude| f64::from(amplitude[index]));
            let reading = Reading { pixel, ray, cosine, amplitude, conditions: self.conditions };
            let z = f64::from(*raw) * self.unit_mm;
            *raw = rounding.raw(1.0 / instrument.distort(&reading, 1.0 / z));
        }
    }

    fn displace(&self, instrument: &Instrument, depth_raw: &mut [u16], rounding: &mut Rounding) {
        let before = depth_raw.to_vec();
        for (index, raw) in depth_raw.iter_mut().enumerate() {
            let shown = instrument.image_pixel([(index % self.width) as f64, (index / self.width) as f64]);
            *raw = match self.between(&before, shown) {
                Some(steps) => rounding.raw(steps * self.unit_mm),
                None => 0,
            };
        }
    }

    /// Depth between pixels, in steps: interpolated in inverse depth, in which planes are linear; that of the nearest
    /// pixel when a neighbour is missing or depth jumps.
    fn between(&self, raw: &[u16], [u, v]: [f64; 2]) -> Option<f64> {
        let value_at = |column: f64, row: f64| {
            let inside = column >= 0.0 && row >= 0.0 && column < self.width as f64 && row < self.height as f64;
            let value = if inside { raw[row as usize * self.width + column as usize] } else { 0 };
            (value != 0).then_some(f64::from(value))
        };
        let nearest = value_at(u.round(), v.round())?;
        let (a, b) = (u - u.floor(), v - v.floor());
        let corners = [
            (value_at(u.floor(), v.floor()), (1.0 - a) * (1.0 - b)),
            (value_at(u.floor() + 1.0, v.floor()), a * (1.0 - b)),
            (value_at(u.floor(), v.floor() + 1.0), (1.0 - a) * b),
            (value_at(u.floor() + 1.0, v.floor() + 1.0), a * b),
        ];
        let mut rho = 0.0;
        for (value, weight) in corners.into_iter().filter(|(_, weight)| *weight > 0.0) {
            match value {
                Some(value) if (value - nearest).abs() < 0.03 * nearest => rho += weight / value,
                _ => return Some(nearest),
            }
        }
        Some(1.0 / rho)
    }
}
