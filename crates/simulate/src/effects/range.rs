//! Effects on range and depth: an offset along the ray, nonlinear and cyclic depth, range reported as depth.

use std::f64::consts::TAU;

use super::info::{Parameters, parameters};
use super::sizing::{Context, usual};
use crate::error::SimulateError;
use crate::instrument::{DepthEffect, Instrument, Reading, Stage, with_depth_added};

/// A signal delay: the range is too large by a constant, δz = offset / √(1 + x² + y²).
struct RangeOffset(f64);

impl DepthEffect for RangeOffset {
    fn stage(&self) -> Stage {
        Stage::Signal
    }

    fn distort(&self, reading: &Reading, rho: f64) -> f64 {
        with_depth_added(rho, self.0 / reading.range_over_depth())
    }
}

pub(super) fn range_offset(_: &Context, size: f64, to: &mut Instrument) -> Result<Parameters, SimulateError> {
    to.add(Box::new(RangeOffset(size)));
    Ok(parameters([("offset_mm", size)]))
}

/// Nonlinear depth: δz = q2 z² + q3 z³, z in metres.
struct Curved([f64; 2]);

impl DepthEffect for Curved {
    fn stage(&self) -> Stage {
        Stage::Signal
    }

    fn distort(&self, _: &Reading, rho: f64) -> f64 {
        let z = 1e-3 / rho;
        with_depth_added(rho, z * z * (self.0[0] + self.0[1] * z))
    }
}

pub(super) fn quadratic_depth(context: &Context, size: f64, to: &mut Instrument) -> Result<Parameters, SimulateError> {
    let form = [context.near(-0.6, 0.4), 1.0];
    let curved = |scale: f64| Curved(form.map(|q| q * scale));
    let scale = size / context.rms_mm(&curved(1.0), usual());
    to.add(Box::new(curved(scale)));
    Ok(parameters([("q2_mm_per_m2", form[0] * scale), ("q3_mm_per_m3", form[1] * scale)]))
}

/// The cyclic error of a time-of-flight camera whose modulation is not sinusoidal: δz = a (sin φ + h sin(2 φ + χ)), φ =
/// 2π z / P + ψ.
struct Cyclic {
    amplitude: f64,
    period: f64,
    phase: f64,
    harmonic: f64,
    harmonic_phase: f64,
}

impl DepthEffect for Cyclic {
    fn stage(&self) -> Stage {
        Stage::Signal
    }

    fn distort(&self, _: &Reading, rho: f64) -> f64 {
        let phase = TAU / (rho * self.period) + self.phase;
        let wave = phase.sin() + self.harmonic * (2.0 * phase + self.harmonic_phase).sin();
        with_depth_added(rho, self.amplitude * wave)
    }
}

pub(super) fn cyclic_depth(context: &Context, size: f64, to: &mut Instrument) -> Result<Parameters, SimulateError> {
    let effect = Cyclic {
        amplitude: size,
        period: context.near(300.0, 60.0),
        phase: context.near(0.4, std::f64::consts::PI),
        harmonic: context.near(0.15, 0.1),
        harmonic_phase: context.near(1.0, std::f64::consts::PI),
    };
    let truth = parameters([
        ("amplitude_mm", effect.amplitude),
        ("period_mm", effect.period),
        ("phase_rad", effect.phase),
        ("harmonic", effect.harmonic),
        ("harmonic_phase_rad", effect.harmonic_phase),
    ]);
    to.add(Box::new(effect));
    Ok(truth)
}

/// Range reported as depth, in part: z_m = z (1 + w (√(1 + x² + y²) − 1)).
struct RadialRange(f64);

impl DepthEffect for RadialRange {
    fn stage(&self) -> Stage {
        Stage::Signal
    }

    fn distort(&self, reading: &Reading, rho: f64) -> f64 {
        rho / (1.0 + self.0 * (reading.range_over_depth() - 1.0))
    }
}

pub(super) fn radial_range(context: &Context, size: f64, to: &mut Instrument) -> Result<Parameters, SimulateError> {
    let part = size / context.rms_mm(&RadialRange(1.0), usual());
    to.add(Box::new(RadialRange(part)));
    Ok(parameters([("part", part)]))
}
