//! The depth image lies displaced on the image.

use super::{Context, Parameters, parameters};
use crate::error::SimulateError;
use crate::instrument::Instrument;

/// What the image shows at (u, v), the depth image shows at (u + du, v + dv).
pub(super) fn depth_registration(
    context: &Context,
    size: f64,
    to: &mut Instrument,
) -> Result<Parameters, SimulateError> {
    let angle = context.near(35.0, 180.0).to_radians();
    to.registration = [size * angle.cos(), size * angle.sin()];
    Ok(parameters([("du_px", to.registration[0]), ("dv_px", to.registration[1])]))
}
