//! Batches of factors with automatic derivatives.

use std::fmt;

use pulp::{Arch, Simd, WithSimd};

use crate::problem::error::EvaluationError;
use crate::problem::factor::{Borrowed, Factor, VariableTuple, value};
use crate::problem::factor_batch::FactorBatch;
use crate::problem::key::VariableId;
use crate::problem::loss::Loss;
use crate::problem::noise::Noise;
use crate::problem::values::Values;

/// Factors of one type with one noise model and one loss.
///
/// Consecutive factors with the same keys form a group, which the solver evaluates in one call and accumulates as one matrix
/// product. Add factors with the same keys one after the other.
pub struct Batch<F: Factor<M>, const M: usize> {
    name: String,
    factors: Vec<F>,
    groups: Vec<Group<F, M>>,
    ids: Vec<VariableId>,
    noise: Noise<M>,
    loss: Loss,
}

struct Group<F: Factor<M>, const M: usize> {
    keys: <F::Variables as VariableTuple>::Keys,
    end: usize,
}

impl<F: Factor<M>, const M: usize> fmt::Debug for Batch<F, M> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Batch").field("name", &self.name).field("factors", &self.len()).finish_non_exhaustive()
    }
}

impl<F: Factor<M>, const M: usize> Batch<F, M> {
    /// A batch without factors, with unit noise and trivial loss.
    pub fn new(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            factors: Vec::new(),
            groups: Vec::new(),
            ids: Vec::new(),
            noise: Noise::unit(),
            loss: Loss::Trivial,
        }
    }

    /// Whitens all residuals by `noise`.
    #[must_use]
    pub fn with_noise(mut self, noise: Noise<M>) -> Self {
        self.noise = noise;
        self
    }

    /// Applies `loss` to the whitened residuals.
    #[must_use]
    pub fn with_loss(mut self, loss: Loss) -> Self {
        self.loss = loss;
        self
    }

    /// Adds a factor over the variables `keys`.
    pub fn push(&mut self, factor: F, keys: <F::Variables as VariableTuple>::Keys) {
        self.factors.push(factor);
        let end = self.factors.len();
        match self.groups.last_mut() {
            Some(last) if last.keys == keys => last.end = end,
            _ => {
                self.groups.push(Group { keys, end });
                F::Variables::ids(&keys, &mut self.ids);
            }
        }
    }

    /// Number of factors.
    pub fn len(&self) -> usize {
        self.factors.len()
    }

    /// Whether there is no factor.
    pub fn is_empty(&self) -> bool {
        self.factors.is_empty()
    }

    fn start(&self, group: usize) -> usize {
        group.checked_sub(1).map_or(0, |before| self.groups[before].end)
    }
}

impl<F: Factor<M>, const M: usize> FactorBatch for Batch<F, M> {
    fn name(&self) -> &str {
        &self.name
    }

    fn group_count(&self) -> usize {
        self.groups.len()
    }

    fn variables(&self, group: usize) -> &[VariableId] {
        &self.ids[group * F::Variables::COUNT..][..F::Variables::COUNT]
    }

    fn row_count(&self, group: usize) -> usize {
        (self.groups[group].end - self.start(group)) * M
    }

    fn residual_dim(&self) -> usize {
        M
    }

    fn loss(&self) -> Loss {
        self.loss.clone()
    }

    fn evaluate(
        &self,
        group: usize,
        values: &Values,
        residuals: &mut [f64],
        jacobian: Option<&mut [f64]>,
    ) -> Result<(), EvaluationError> {
        let factors = &self.factors[self.start(group)..self.groups[group].end];
        let variables = F::Variables::borrow(&self.groups[group].keys, values)
            .ok_or(EvaluationError::new("a variable of the group is not among these values"))?;
        let noise = &self.noise;
        Arch::new().dispatch(Evaluation { factors, variables, noise, residuals, jacobian });
        Ok(())
    }
}

/// The evaluation of one group, compiled for the vector instructions of the machine.
struct Evaluation<'a, F: Factor<M>, const M: usize> {
    factors: &'a [F],
    variables: Borrowed<'a, F::Variables>,
    noise: &'a Noise<M>,
    residuals: &'a mut [f64],
    jacobian: Option<&'a mut [f64]>,
}

impl<F: Factor<M>, const M: usize> WithSimd for Evaluation<'_, F, M> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { factors, variables, noise, residuals, jacobian } = self;
        let rows = factors.iter().zip(residuals.chunks_exact_mut(M));
        match jacobian {
            None => {
                for (factor, r) in rows {
                    r.copy_from_slice(noise.whiten(value(factor, &variables)).as_slice());
                }
            }
            Some(jacobian) => {
                let dim = F::Variables::DIM;
                for ((factor, r), j) in rows.zip(jacobian.chunks_exact_mut(M * dim)) {
                    r.copy_from_slice(noise.whiten(factor.linearize(&variables, j)).as_slice());
                    noise.whiten_rows(j, dim);
                }
            }
        }
    }
}
