//! Effects that change with time or temperature: baseline and angles of the camera settle, or expand thermally.

use super::info::{Parameters, parameters};
use super::sizing::{Context, usual};
use crate::conditions::{Conditions, REFERENCE_TEMPERATURE_C};
use crate::error::SimulateError;
use crate::instrument::{DepthEffect, Instrument, Reading, Stage};

/// The variable that drives a drift.
#[derive(Clone, Copy)]
enum Clock {
    /// 1 − exp(−t/τ), τ as a share of the session.
    Settling { share_of_session: f64 },
    /// (T − reference) / 5 °C.
    Temperature,
}

impl Clock {
    fn read(self, conditions: &Conditions) -> f64 {
        match self {
            Self::Settling { share_of_session } => {
                1.0 - (-conditions.time_s / (share_of_session * conditions.session_s)).exp()
            }
            Self::Temperature => (conditions.temperature_c - REFERENCE_TEMPERATURE_C) / 5.0,
        }
    }
}

/// ρ_m = ρ + g (s ρ + o), with g given by the clock.
struct Drift {
    scale: f64,
    offset: f64,
    clock: Clock,
}

impl DepthEffect for Drift {
    fn stage(&self) -> Stage {
        Stage::Output
    }

    fn distort(&self, reading: &Reading, rho: f64) -> f64 {
        rho + self.clock.read(&reading.conditions) * (self.scale * rho + self.offset)
    }
}

/// Adds a drift whose effect on depth has the rms `size` (mm) under the conditions `full`; returns scale and offset
/// (1/mm).
fn install(context: &Context, size: f64, clock: Clock, full: Conditions, to: &mut Instrument) -> [f64; 2] {
    // At 1 m the scale contributes a third to two thirds of the effect, the offset the rest.
    let share = context.near(0.5, 0.17);
    let drift_of = |amount: f64| Drift { scale: amount * share, offset: amount * (1.0 - share) / 1000.0, clock };
    let amount = 1e-4 * size / context.rms_mm(&drift_of(1e-4), full);
    let drift = drift_of(amount);
    let truth = [drift.scale, drift.offset];
    to.add(Box::new(drift));
    truth
}

pub(super) fn temporal_drift(context: &Context, size: f64, to: &mut Instrument) -> Result<Parameters, SimulateError> {
    let share_of_session = context.near(1.0 / 3.0, 0.08);
    let settled = Conditions { time_s: 1e6, ..usual() };
    let [scale, offset] = install(context, size, Clock::Settling { share_of_session }, settled, to);
    Ok(parameters([("scale", scale), ("offset_per_mm", offset), ("time_constant_share_of_session", share_of_session)]))
}

pub(super) fn temperature_drift(
    context: &Context,
    size: f64,
    to: &mut Instrument,
) -> Result<Parameters, SimulateError> {
    let warmer = Conditions { temperature_c: REFERENCE_TEMPERATURE_C + 5.0, ..usual() };
    let [scale, offset] = install(context, size, Clock::Temperature, warmer, to);
    Ok(parameters([
        ("scale_per_5_c", scale),
        ("offset_per_mm_per_5_c", offset),
        ("reference_c", REFERENCE_TEMPERATURE_C),
    ]))
}
