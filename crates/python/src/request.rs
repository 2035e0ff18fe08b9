//! The arguments that several functions take: effects, the model in words, frames that are held out.

use depthcal_calibration::calibrate::{CameraOptions, Estimator};
use depthcal_calibration::progress::ProgressHandle;
use depthcal_calibration::task::{HoldOut, ModelRequest, OptionNames};
use depthcal_model::Register;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arguments::argument;
use crate::effect::Effect;
use crate::failure::{Failure, input};

/// The register of a call: depthcal's pieces and the given effects.
pub(crate) fn register_with(effects: &[PyRef<'_, Effect>]) -> PyResult<Register> {
    let mut register = Register::builtin();
    for effect in effects {
        effect.register(&mut register)?;
    }
    Ok(register)
}

/// The model of the arguments `model`, `with`, `effects` and `lens`, and a register with the given effects and those of its files
/// of formulas.
pub(crate) fn model_request(given: &Bound<'_, PyDict>) -> PyResult<(ModelRequest, Register)> {
    let lens: Option<String> = argument(given, "lens")?;
    let mut register = register_with(&argument::<Vec<PyRef<'_, Effect>>>(given, "effects")?)?;
    let (model, with) = (argument(given, "model")?, argument(given, "with")?);
    let mut request = ModelRequest { names: OptionNames::ARGUMENTS, model, with, lens };
    request.load_formulas(&mut register).map_err(Failure::from)?;
    Ok((request, register))
}

/// Default options with a register and progress.
pub(crate) fn base_options(register: &Register, progress: &ProgressHandle) -> CameraOptions {
    CameraOptions { register: register.clone(), progress: progress.clone(), ..CameraOptions::default() }
}

/// A number of cross-validation folds that a diagnosis can do with.
pub(crate) fn checked_folds(folds: usize) -> Result<usize, Failure> {
    if folds < 2 { Err(input(format!("folds is {folds}: give at least 2"))) } else { Ok(folds) }
}

/// The estimator of that name.
pub(crate) fn estimator_of(name: &str) -> Result<Estimator, Failure> {
    let all = [Estimator::Joint, Estimator::Linear, Estimator::Irls, Estimator::Nonlinear];
    let known = || input(format!("estimator '{name}' is unknown; known are {}", all.map(Estimator::name).join(", ")));
    all.into_iter().find(|estimator| estimator.name() == name).ok_or_else(known)
}

/// Frames that are held out: `(every, first)` holds out every N-th frame, beginning with this number from 1.
pub(crate) fn hold_out_of(given: Option<(usize, usize)>) -> Result<Option<HoldOut>, Failure> {
    match given {
        Some((every, first)) if every < 2 || first < 1 || first > every => {
            Err(input(format!("hold_out ({every}, {first}): N must be at least 2 and K from 1 to N")))
        }
        other => Ok(other.map(|(every, first)| HoldOut { every, first: first - 1 })),
    }
}

/// A record as JSON.
pub(crate) fn json(record: &impl serde::Serialize) -> PyResult<String> {
    Ok(serde_json::to_string(record).map_err(input)?)
}
