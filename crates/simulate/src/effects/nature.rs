//! Functions that no catalogue has: family, covariates, place and form are drawn at random, and declared to nobody.
//!
//! A capture's function is f of one covariate or the product of functions of two, each over the usual range of its covariate
//! mapped to −1 … 1. Waves and smooth functions of depth, of amplitude and of incidence alone are left to the catalogue.

use std::f64::consts::PI;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::info::{Parameters, parameters};
use super::place::{Form, Place, Placed};
use super::sizing::{Context, usual};
use crate::error::SimulateError;
use crate::instrument::{DepthEffect, Instrument, Reading, Stage, with_depth_added};

/// A quantity that a function depends on.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Covariate {
    Column,
    Row,
    Radius,
    Depth,
    Amplitude,
    Incidence,
}

const COVARIATES: [Covariate; 6] = [
    Covariate::Column,
    Covariate::Row,
    Covariate::Radius,
    Covariate::Depth,
    Covariate::Amplitude,
    Covariate::Incidence,
];

/// A function on −1 … 1.
#[derive(Debug, Clone)]
enum Shape {
    /// Σ a_k cos(k π (t + 1) / 2), k from 2: without a constant and nearly without a slope.
    Spline(Vec<f64>),
    /// A jump at t.
    Step(f64),
    /// A straight line that begins at t.
    Hinge(f64),
    /// A wave of so many cycles with a phase.
    Wave { cycles: f64, phase: f64 },
}

impl Shape {
    fn draw(rng: &mut ChaCha8Rng, family: usize) -> Self {
        match family {
            0 => {
                let amplitude = |k: usize| rng.sample::<f64, _>(StandardNormal) / k as f64;
                Self::Spline((2..7).map(amplitude).collect())
            }
            1 => Self::Step(rng.random_range(-0.5..0.5)),
            2 => Self::Hinge(rng.random_range(-0.4..0.4)),
            _ => Self::Wave { cycles: rng.random_range(1.5..6.0), phase: rng.random_range(0.0..2.0 * PI) },
        }
    }

    fn at(&self, t: f64) -> f64 {
        match self {
            Self::Spline(amplitudes) => {
                let each = amplitudes.iter().zip(2..);
                each.map(|(a, k)| a * (f64::from(k) * PI * (t.clamp(-1.5, 1.5) + 1.0) / 2.0).cos()).sum()
            }
            Self::Step(at) => f64::from(u8::from(t > *at)),
            Self::Hinge(at) => (t - at).max(0.0),
            Self::Wave { cycles, phase } => (cycles * PI * t + phase).sin(),
        }
    }
}

/// The function in depth, mm at 1 m.
struct Function {
    scale: f64,
    size: [f64; 2],
    factors: Vec<(Covariate, Shape)>,
}

impl Function {
    fn covariate(&self, covariate: Covariate, reading: &Reading, rho: f64) -> f64 {
        match covariate {
            Covariate::Column => 2.0 * reading.pixel[0] / self.size[0] - 1.0,
            Covariate::Row => 2.0 * reading.pixel[1] / self.size[1] - 1.0,
            Covariate::Radius => reading.ray[0].hypot(reading.ray[1]) / 0.35 - 1.0,
            Covariate::Depth => (1.0 / rho - 800.0) / 400.0,
            Covariate::Amplitude => reading.amplitude.max(0.01).ln() + 1.2,
            Covariate::Incidence => 4.0 * (1.0 / reading.cosine.max(0.2) - 1.0) - 1.0,
        }
    }
}

impl DepthEffect for Function {
    fn stage(&self) -> Stage {
        Stage::Signal
    }

    fn distort(&self, reading: &Reading, rho: f64) -> f64 {
        let value: f64 = self.factors.iter().map(|(c, shape)| shape.at(self.covariate(*c, reading, rho))).product();
        with_depth_added(rho, self.scale * value)
    }
}

/// Whether a function of one covariate is one that an effect of the catalogue describes, or nearly.
fn is_catalogued(covariate: Covariate, shape: &Shape) -> bool {
    match covariate {
        Covariate::Depth => !matches!(shape, Shape::Step(_)),
        Covariate::Amplitude => matches!(shape, Shape::Spline(_) | Shape::Hinge(_)),
        Covariate::Incidence => matches!(shape, Shape::Hinge(_)),
        Covariate::Radius => matches!(shape, Shape::Hinge(_)),
        Covariate::Column | Covariate::Row => false,
    }
}

pub(super) fn nature(context: &Context, size: f64, to: &mut Instrument) -> Result<Parameters, SimulateError> {
    let mut rng = context.unit_stream();
    let factors = loop {
        let mut factor = || {
            let covariate = COVARIATES[rng.random_range(0..COVARIATES.len())];
            let family = rng.random_range(0..4);
            (covariate, Shape::draw(&mut rng, family))
        };
        let first = factor();
        let second = factor();
        if rng.random_bool(0.35) && second.0 != first.0 {
            break vec![first, second];
        }
        if !is_catalogued(first.0, &first.1) {
            break vec![first];
        }
    };
    let place = Place::ALL[rng.random_range(0..Place::ALL.len())];
    let form = Form::ALL[rng.random_range(0..Form::ALL.len())];
    let image = [context.camera.width as f64, context.camera.height as f64];
    let placed = |scale: f64| Placed {
        effect: Box::new(Function { scale, size: image, factors: factors.clone() }),
        own: Form::Depth,
        place,
        form,
    };
    // The reference volume has one amplitude and no tilt: functions of them have the size that they have where they are 1.
    let rms = context.rms_mm(&placed(1.0), usual());
    let scale = if rms > 0.1 { size / rms } else { size };
    to.add(Box::new(placed(scale)));
    let mut truth = parameters([("scale_mm", scale)]);
    for (covariate, shape) in &factors {
        truth.insert(format!("{covariate:?} {shape:?}"), 1.0);
    }
    truth.insert(format!("of {} on {}", place.name(), form.name()), 1.0);
    Ok(truth)
}
