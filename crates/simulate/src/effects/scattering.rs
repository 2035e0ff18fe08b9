//! Stray light: a share of the light of the whole scene falls on every pixel, and light of the nearest pixels delays the signal.

use super::info::{Parameters, parameters};
use super::sizing::Context;
use crate::error::SimulateError;
use crate::instrument::{Instrument, Scattering};

/// Delay by the nearest pixels, rad at 80 MHz, per share of the scene's light.
const DELAY_PER_SHARE: f64 = 10.0;

pub(super) fn stray_light(context: &Context, size: f64, to: &mut Instrument) -> Result<Parameters, SimulateError> {
    let share = size / 100.0;
    let delay_rad = share * context.near(DELAY_PER_SHARE, 2.0);
    to.scattering = (size != 0.0).then_some(Scattering { share, delay_rad });
    Ok(parameters([("share", share), ("delay_rad", delay_rad)]))
}
