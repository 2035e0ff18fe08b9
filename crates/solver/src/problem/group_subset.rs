//! A batch restricted to some of its groups.

use std::sync::Arc;

use crate::problem::error::EvaluationError;
use crate::problem::factor_batch::FactorBatch;
use crate::problem::key::VariableId;
use crate::problem::lane::{Lane, LaneAccess};
use crate::problem::loss::Loss;
use crate::problem::values::Values;

/// A batch without some of its groups.
pub(crate) struct GroupSubset {
    whole: Arc<dyn FactorBatch>,
    /// The remaining groups' numbers in the whole batch.
    groups: Vec<usize>,
}

impl GroupSubset {
    /// Keeps the groups for which `keep` is true; `None` if these are all groups.
    pub fn new(whole: &Arc<dyn FactorBatch>, mut keep: impl FnMut(usize) -> bool) -> Option<Self> {
        let groups: Vec<usize> = (0..whole.group_count()).filter(|g| keep(*g)).collect();
        (groups.len() < whole.group_count()).then(|| Self { whole: Arc::clone(whole), groups })
    }
}

impl FactorBatch for GroupSubset {
    fn name(&self) -> &str {
        self.whole.name()
    }

    fn group_count(&self) -> usize {
        self.groups.len()
    }

    fn variables(&self, group: usize) -> &[VariableId] {
        self.whole.variables(self.groups[group])
    }

    fn row_count(&self, group: usize) -> usize {
        self.whole.row_count(self.groups[group])
    }

    fn residual_dim(&self) -> usize {
        self.whole.residual_dim()
    }

    fn loss(&self) -> Loss {
        self.whole.loss()
    }

    fn evaluate(
        &self,
        group: usize,
        values: &Values,
        residuals: &mut [f64],
        jacobian: Option<&mut [f64]>,
    ) -> Result<(), EvaluationError> {
        self.whole.evaluate(self.groups[group], values, residuals, jacobian)
    }

    fn lanes(&self, group: usize) -> Option<&dyn LaneAccess> {
        self.whole.lanes(self.groups[group]).is_some().then_some(self)
    }
}

impl LaneAccess for GroupSubset {
    fn evaluate_lanes(
        &self,
        group: usize,
        values: &Values,
        blocks: &mut [Lane],
        jacobian: bool,
    ) -> Result<(), EvaluationError> {
        let group = self.groups[group];
        match self.whole.lanes(group) {
            Some(lanes) => lanes.evaluate_lanes(group, values, blocks, jacobian),
            None => Err(EvaluationError::new("the batch does not support evaluation in lanes")),
        }
    }
}
