//! Effects of triangulation: distortion of the projected pattern, and sub-pixel locking.

use std::f64::consts::TAU;

use super::info::{Parameters, parameters};
use super::sizing::{Context, usual};
use crate::error::SimulateError;
use crate::instrument::{DepthEffect, Instrument, Reading, Stage};

/// A decentred projector lens distorts its pattern: along the baseline, a feature at (x, y) of the projector's
/// normalised image plane is displaced by p (3x² + y²) + q xy + k x (x² + y²), and the disparity is wrong by the same
/// amount.
struct ProjectorDistortion {
    scale: f64,
    form: [f64; 3],
    baseline: f64,
}

impl DepthEffect for ProjectorDistortion {
    fn stage(&self) -> Stage {
        Stage::Disparity
    }

    fn distort(&self, reading: &Reading, rho: f64) -> f64 {
        let [p, q, k] = self.form;
        // The surface as the projector sees it, from a baseline away.
        let (x, y) = (reading.ray[0] - self.baseline * rho, reading.ray[1]);
        let moved = p * (3.0 * x * x + y * y) + q * x * y + k * x * (x * x + y * y);
        rho + self.scale * moved / self.baseline
    }
}

pub(super) fn projector_distortion(
    context: &Context,
    size: f64,
    to: &mut Instrument,
) -> Result<Parameters, SimulateError> {
    let form = [context.near(1.0, 0.4), context.near(1.2, 0.8), context.near(0.5, 0.4)];
    let baseline = context.camera.baseline_mm;
    let distortion = |scale: f64| ProjectorDistortion { scale, form, baseline };
    let scale = 1e-6 * size / context.rms_mm(&distortion(1e-6), usual());
    to.add(Box::new(distortion(scale)));
    let [p, q, k] = form.map(|f| f * scale);
    Ok(parameters([("p", p), ("q", q), ("k", k), ("baseline_mm", baseline)]))
}

/// Sub-pixel locking of the disparity: δρ = a sin(2π d / P + φ), d the disparity in pixels.
struct Ripple {
    amplitude: f64,
    period: f64,
    phase: f64,
    disparity_scale: f64,
}

impl DepthEffect for Ripple {
    fn stage(&self) -> Stage {
        Stage::Disparity
    }

    fn distort(&self, _: &Reading, rho: f64) -> f64 {
        rho + self.amplitude * (TAU * rho * self.disparity_scale / self.period + self.phase).sin()
    }
}

pub(super) fn disparity_ripple(context: &Context, size: f64, to: &mut Instrument) -> Result<Parameters, SimulateError> {
    let period = context.near(4.0, 1.0);
    let phase = context.near(0.7, std::f64::consts::PI);
    let disparity_scale = context.camera.disparity_scale();
    let ripple = |amplitude: f64| Ripple { amplitude, period, phase, disparity_scale };
    let amplitude = 1e-7 * size / context.rms_mm(&ripple(1e-7), usual());
    to.add(Box::new(ripple(amplitude)));
    Ok(parameters([
        ("amplitude_per_mm", amplitude),
        ("period_px", period),
        ("period_per_mm", period / disparity_scale),
        ("phase_rad", phase),
    ]))
}
