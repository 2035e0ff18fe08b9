//! Displacement of the depth image relative to the image.

use super::info::{Parameters, parameters};
use super::sizing::Context;
use crate::error::SimulateError;
use crate::instrument::Instrument;

/// The depth image shows at (u + du, v + dv) what the image shows at (u, v).
pub(super) fn depth_registration(
    context: &Context,
    size: f64,
    to: &mut Instrument,
) -> Result<Parameters, SimulateError> {
    let angle = context.near(35.0, 180.0).to_radians();
    to.registration = [size * angle.cos(), size * angle.sin()];
    Ok(parameters([("du_px", to.registration[0]), ("dv_px", to.registration[1])]))
}
