//! The bare value of a formula as a function of its covariates.

use depthcal_model::{Context, Options};

use crate::content::Content;
use crate::covariate::FormulaCovariate;
use crate::graph::{Graph, Tape};
use crate::lowering::{Meaning, lower};

/// The value of a formula as a function of its covariates, each of which may have any value.
#[derive(Debug, Clone)]
pub struct FormulaFunction {
    covariates: Vec<FormulaCovariate>,
    values: usize,
    tape: Tape,
}

impl FormulaFunction {
    pub(crate) fn new(content: &Content) -> Self {
        let mut graph = Graph::default();
        let meaning = content.meaning(&Options::new());
        let place = |covariate: FormulaCovariate| content.covariates.iter().position(|c| *c == covariate).unwrap_or(0);
        let as_input = |name: &str| match meaning(name) {
            Meaning::Covariate(covariate) => Meaning::State(place(covariate) as u8),
            other => other,
        };
        let outputs: Vec<_> =
            content.expressions.iter().map(|e| lower(&mut graph, content.hook(), e, &as_input)).collect();
        Self { covariates: content.covariates.clone(), values: outputs.len(), tape: Tape::new(&graph, &outputs) }
    }

    /// The covariates, in the order of the arguments.
    pub fn covariates(&self) -> &[FormulaCovariate] {
        &self.covariates
    }

    /// The values of the formulas (one, or two for two coordinates) for parameters `theta` and covariates in their order.
    pub fn values(&self, theta: &[f64], covariates: &[f64]) -> [f64; 2] {
        let mut values = [0.0; 2];
        let inputs = self.covariates.len();
        self.tape.run(theta, covariates, inputs, &[Context::default()], |_, k, value| {
            if k < self.values.min(2) {
                values[k] = value;
            }
        });
        values
    }
}
