//! The installation of effects in camera and board.

use serde::{Deserialize, Serialize};

use super::effect::{Effect, bad_size};
use super::info::Parameters;
use super::sizing::Context;
use crate::board::Board;
use crate::camera::CameraTruth;
use crate::error::SimulateError;
use crate::instrument::Instrument;

/// An installed effect with all its parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EffectTruth {
    /// Its name.
    pub name: String,
    /// Its size.
    pub size: f64,
    /// Unit of the size.
    pub unit: String,
    /// Parameters of its form, by name; the names end with their units.
    pub parameters: Parameters,
}

/// Camera and board with all of `effects`.
pub(crate) fn install(
    camera: &CameraTruth,
    board: &Board,
    effects: &[Effect],
    unit: u64,
    seed: u64,
) -> Result<(Instrument, Vec<EffectTruth>), SimulateError> {
    let mut instrument = Instrument::new(camera, board);
    let install_one = |effect: &Effect| {
        let info = effect.info()?;
        if !effect.size.is_finite() {
            return Err(bad_size(info, &effect.size.to_string()));
        }
        let context = Context::new(camera, board, info.name, unit, seed);
        let parameters = (info.install)(&context, effect.size, &mut instrument)?;
        Ok(EffectTruth { name: info.name.to_owned(), size: effect.size, unit: info.unit.to_owned(), parameters })
    };
    let truths = effects.iter().map(install_one).collect::<Result<_, _>>()?;
    Ok((instrument, truths))
}
