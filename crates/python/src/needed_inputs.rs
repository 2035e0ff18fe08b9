//! Inputs of a frame besides depth that a camera's effects need, and warnings where they are missing.

use depthcal_model::hook::HookKind;
use depthcal_model::{Camera, Covariate};
use pyo3::prelude::*;

use crate::warned::warn;

/// Names of the effects that need an input, by input.
#[derive(Debug, Clone, Default)]
pub(crate) struct NeededInputs {
    time: Vec<String>,
    temperature: Vec<String>,
    amplitude: Vec<String>,
}

impl NeededInputs {
    pub fn of(camera: &Camera) -> Self {
        let names = |covariates: &[Covariate]| {
            let depth = camera.blocks().iter().filter(|block| block.hook() == HookKind::Depth);
            let needs =
                |piece: &dyn depthcal_model::AnyPiece| piece.needs().iter().any(|need| covariates.contains(need));
            let needing = depth.filter(|block| block.piece().is_some_and(|piece| needs(&**piece)));
            needing.map(|block| block.name().to_owned()).collect()
        };
        Self {
            time: names(&[Covariate::Time]),
            temperature: names(&[Covariate::Temperature]),
            amplitude: names(&[Covariate::Amplitude, Covariate::Surroundings, Covariate::StrayLight]),
        }
    }

    /// Warns of every input that effects need and that is not given: they are then not corrected.
    pub fn warn_of_missing(
        &self,
        py: Python<'_>,
        has_time: bool,
        has_temperature: bool,
        has_amplitude: bool,
    ) -> PyResult<()> {
        let inputs = [
            ("time_s", &self.time, has_time, "are taken as at time 0"),
            ("temperature_c", &self.temperature, has_temperature, "stay in the result"),
            ("amplitude", &self.amplitude, has_amplitude, "stay in the result"),
        ];
        for (name, effects, is_given, fate) in inputs {
            if !is_given && !effects.is_empty() {
                let effects = effects.join(", ");
                warn(py, &format!("{name} is not given: effects that depend on it, {effects}, {fate}; give {name}"))?;
            }
        }
        Ok(())
    }
}
