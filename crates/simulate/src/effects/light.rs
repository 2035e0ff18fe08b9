//! Effects of the returned light: angle of incidence, and amplitude.

use super::info::{Parameters, parameters};
use super::sizing::Context;
use crate::error::SimulateError;
use crate::instrument::{DepthEffect, Instrument, Reading, Stage, with_depth_added};

/// Bias that grows with the angle of incidence, as by subsurface scattering: δz = c (1/cos − 1).
struct Incidence(f64);

impl DepthEffect for Incidence {
    fn stage(&self) -> Stage {
        Stage::Signal
    }

    fn distort(&self, reading: &Reading, rho: f64) -> f64 {
        with_depth_added(rho, self.0 * (1.0 / reading.cosine.max(0.1) - 1.0))
    }
}

pub(super) fn incidence_bias(_: &Context, size: f64, to: &mut Instrument) -> Result<Parameters, SimulateError> {
    let coefficient = size / (std::f64::consts::SQRT_2 - 1.0);
    to.add(Box::new(Incidence(coefficient)));
    Ok(parameters([("coefficient_mm", coefficient)]))
}

/// Dark surfaces appear too far, bright ones too near: δz = −c ln(amplitude / reference).
struct Reflectivity {
    coefficient: f64,
    reference: f64,
}

/// Signal below which the logarithm is cut off, share of full scale; weaker signals are noise.
const DARKEST: f64 = 0.003;

impl DepthEffect for Reflectivity {
    fn stage(&self) -> Stage {
        Stage::Signal
    }

    fn distort(&self, reading: &Reading, rho: f64) -> f64 {
        with_depth_added(rho, -self.coefficient * (reading.amplitude.max(DARKEST) / self.reference).ln())
    }
}

pub(super) fn reflectivity_bias(
    context: &Context,
    size: f64,
    to: &mut Instrument,
) -> Result<Parameters, SimulateError> {
    let contrast = (context.board.bright / context.board.dark).ln();
    let effect = Reflectivity { coefficient: size / contrast, reference: context.near(0.3, 0.1) };
    let truth = parameters([("coefficient_mm", effect.coefficient), ("reference_amplitude", effect.reference)]);
    to.add(Box::new(effect));
    Ok(truth)
}
