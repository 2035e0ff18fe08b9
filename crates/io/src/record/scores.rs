//! `scores.json`: what a calibration's observations say of the effects that its model lacks.

use std::collections::BTreeMap;

use depthcal_model::FormulaDefinition;
use serde::{Deserialize, Serialize};

use super::options::{self, OptionValue};
use super::reference::FileReference;
use super::result_file::result_file;
use crate::file::{Fault, Versioned, read_versioned, write_versioned};

/// Scores of the effects that the model of a calibration lacks, for pooling over the units of a fleet.
///
/// Of independent captures scores and information add up. The file lies next to the `calibration.json` that it belongs to, and
/// carries `"format": "depthcal-scores"` and `"version": 1` in addition to these fields. Rows and columns are the parameters of
/// all effects, one effect after the other.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Scores {
    /// The dataset that was fitted.
    pub dataset: FileReference,
    /// The fitted parameters, in the order of the rows of `response`, at which the scores were taken.
    pub model: Vec<ModelValue>,
    /// Number of frames.
    pub frames: usize,
    /// The effects.
    pub effects: Vec<ScoredEffect>,
    /// Gradient U of the log-likelihood by the effects' parameters at their nominal values, everything else projected out.
    pub score: Vec<f64>,
    /// Information V on these parameters jointly with everything else that is fitted.
    pub information: Vec<Vec<f64>>,
    /// Change of the fitted parameters per unit of an effect's parameter: one row per entry of `model`.
    pub response: Vec<Vec<f64>>,
}

result_file!(Scores, "scores.json", read_versioned, write_versioned);

/// A fitted parameter and its value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct ModelValue {
    /// Name, `piece.parameter`.
    pub name: String,
    /// Estimate, in the parameter's unit.
    pub value: f64,
}

/// An effect that a model lacks.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct ScoredEffect {
    /// Its name.
    pub effect: String,
    /// The effect as given to `calibrate --with`; its constants have their defaults, so that all units test the same.
    pub with: String,
    /// Its constants by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty", with = "options")]
    #[schemars(with = "BTreeMap<String, OptionValue>")]
    pub options: BTreeMap<String, f64>,
    /// Its parameters.
    pub parameters: Vec<ScoredParameter>,
    /// Scatter of the frames' scores less what the effect itself explains of them, Σ uᵢuᵢᵀ: the information where frames are
    /// independent and the noise is as the model says. One row and column per parameter.
    pub scatter: Vec<Vec<f64>>,
    /// Mean square over the observations of what the model's parameters do not compensate of the effect, mm², as a quadratic
    /// form in its parameters' departures from their nominal values.
    pub square_mm2: Vec<Vec<f64>>,
    /// The definition of an effect that is given as a formula.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub formula: Option<FormulaDefinition>,
}

/// A parameter of an effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct ScoredParameter {
    /// Name within the effect.
    pub name: String,
    /// Unit; `1` for a dimensionless parameter.
    pub unit: String,
    /// Value at which the effect does nothing.
    pub nominal: f64,
}

impl Scores {
    /// Places of an effect's parameters among rows and columns, by its number.
    pub fn places(&self, effect: usize) -> std::ops::Range<usize> {
        let first = self.effects[..effect].iter().map(|e| e.parameters.len()).sum();
        first..first + self.effects[effect].parameters.len()
    }
}

impl Versioned for Scores {
    const FORMAT: &'static str = "depthcal-scores";
    const VERSION: u32 = 1;
    const COMPACT: bool = true;

    fn check(&self) -> Result<(), Fault> {
        let n: usize = self.effects.iter().map(|e| e.parameters.len()).sum();
        let is = |matrix: &[Vec<f64>], rows: usize, columns: usize| {
            matrix.len() == rows && matrix.iter().all(|row| row.len() == columns)
        };
        if self.score.len() != n {
            return Err(Fault::new("score", format!("must have one number per parameter of the effects, {n}")));
        }
        if !is(&self.information, n, n) {
            return Err(Fault::new("information", format!("must be {n}×{n}, one row per parameter of the effects")));
        }
        if !is(&self.response, self.model.len(), n) {
            let problem = format!("must be {}×{n}: a row per parameter of the model", self.model.len());
            return Err(Fault::new("response", problem));
        }
        for (i, effect) in self.effects.iter().enumerate() {
            let n = effect.parameters.len();
            for (field, matrix) in [("scatter", &effect.scatter), ("square_mm2", &effect.square_mm2)] {
                if !is(matrix, n, n) {
                    return Err(Fault::new(format!("effects[{i}].{field}"), format!("must be {n}×{n}")));
                }
            }
        }
        Ok(())
    }
}
