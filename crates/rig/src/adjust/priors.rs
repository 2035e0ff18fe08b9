//! Priors of single parameters.

use depthcal_solver::{EvaluationError, FactorBatch, Key, Loss, Values, VariableId};
use nalgebra::DVector;

/// Normal priors of components of one block: (θ − mean) / σ.
#[derive(Debug, Clone)]
pub struct PriorBatch {
    name: String,
    key: Key<DVector<f64>>,
    variables: [VariableId; 1],
    size: usize,
    /// Component, mean, standard deviation.
    rows: Vec<(usize, f64, f64)>,
}

impl PriorBatch {
    /// Priors (component, mean, standard deviation) of a block of `size` parameters.
    pub fn new(name: String, key: Key<DVector<f64>>, size: usize, rows: Vec<(usize, f64, f64)>) -> Self {
        Self { name, key, variables: [key.id()], size, rows }
    }
}

impl FactorBatch for PriorBatch {
    fn name(&self) -> &str {
        &self.name
    }

    fn group_count(&self) -> usize {
        1
    }

    fn variables(&self, _: usize) -> &[VariableId] {
        &self.variables
    }

    fn row_count(&self, _: usize) -> usize {
        self.rows.len()
    }

    fn loss(&self) -> Loss {
        Loss::Trivial
    }

    fn evaluate(
        &self,
        _: usize,
        values: &Values,
        residuals: &mut [f64],
        jacobian: Option<&mut [f64]>,
    ) -> Result<(), EvaluationError> {
        let theta = values.get(self.key);
        for (residual, (component, mean, sigma)) in residuals.iter_mut().zip(&self.rows) {
            *residual = (theta[*component] - mean) / sigma;
        }
        if let Some(jacobian) = jacobian {
            jacobian.fill(0.0);
            for (row, (component, _, sigma)) in jacobian.chunks_exact_mut(self.size).zip(&self.rows) {
                row[*component] = 1.0 / sigma;
            }
        }
        Ok(())
    }
}
