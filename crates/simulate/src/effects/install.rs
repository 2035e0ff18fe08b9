//! The installation of effects in camera and board.

use serde::{Deserialize, Serialize};

use super::effect::{Effect, bad_size};
use super::given::GivenEffect;
use super::info::Parameters;
use super::place::{Form, Place, Placed};
use super::sizing::Context;
use crate::board::Board;
use crate::camera::CameraTruth;
use crate::error::SimulateError;
use crate::instrument::{Instrument, Stage};

/// An installed effect with all its parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EffectTruth {
    /// Its name.
    pub name: String,
    /// Its size.
    pub size: f64,
    /// Unit of the size.
    pub unit: String,
    /// Where it acts, if not in its own place and form.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub place: Option<(Place, Form)>,
    /// Parameters of its form, by name; the names end with their units.
    pub parameters: Parameters,
}

impl EffectTruth {
    /// That of an effect that was given as a function, which alone knows its size.
    pub(crate) fn of_given(given: &GivenEffect) -> Self {
        Self {
            name: given.name.clone(),
            size: 1.0,
            unit: "as given".to_owned(),
            place: Some((given.place, given.form)),
            parameters: Parameters::default(),
        }
    }
}

/// The form that an effect has by itself.
fn own_form(name: &str, stage: Stage) -> Form {
    match (name, stage) {
        ("radial_range", _) => Form::Factor,
        (_, Stage::Signal) => Form::Depth,
        (_, Stage::Disparity | Stage::Output) => Form::InverseDepth,
    }
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
        let parameters = match effect.place {
            None => (info.install)(&context, effect.size, &mut instrument)?,
            Some((place, form)) => {
                let mut alone = Instrument::new(camera, board);
                let parameters = (info.install)(&context, effect.size, &mut alone)?;
                for moved in alone.into_effects() {
                    let own_form = own_form(info.name, moved.stage());
                    instrument.add(Box::new(Placed { effect: moved, own: own_form, place, form }));
                }
                parameters
            }
        };
        Ok(EffectTruth {
            name: info.name.to_owned(),
            size: effect.size,
            unit: info.unit.to_owned(),
            place: effect.place,
            parameters,
        })
    };
    let truths = effects.iter().map(install_one).collect::<Result<_, _>>()?;
    Ok((instrument, truths))
}
