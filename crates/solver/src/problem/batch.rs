//! Batches of factors with automatic derivatives.

use std::fmt;

use nalgebra::SVector;
use pulp::{Arch, Simd, WithSimd};

use crate::problem::error::EvaluationError;
use crate::problem::factor::{Borrowed, Factor, VariableTuple, value};
use crate::problem::factor_batch::FactorBatch;
use crate::problem::key::VariableId;
use crate::problem::lane::{FEWEST, LANES, Lane, LaneAccess};
use crate::problem::loss::Loss;
use crate::problem::noise::Noise;
use crate::problem::unrolled::unrolled;
use crate::problem::values::Values;

/// Factors of one type with one noise model and one loss.
///
/// Consecutive factors with the same keys form a group, which the solver evaluates in one call and accumulates as one matrix
/// product. Add factors with the same keys one after the other. Groups of 16 or more factors are evaluated together, which
/// becomes vector instructions where [`residual`](Factor::residual) is `#[inline(always)]`, does not branch on data and calls
/// nothing that is not inlined.
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

    fn variables_of<'a>(
        &self,
        group: usize,
        values: &'a Values,
    ) -> Result<Borrowed<'a, F::Variables>, EvaluationError> {
        F::Variables::borrow(&self.groups[group].keys, values)
            .ok_or(EvaluationError::new("a variable of the group is not among these values"))
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
        let variables = self.variables_of(group, values)?;
        let noise = &self.noise;
        let rows = factors.iter().zip(residuals.chunks_exact_mut(M));
        match jacobian {
            None => {
                for (factor, r) in rows {
                    r.copy_from_slice(noise.whiten(value(factor, &variables)).as_slice());
                }
            }
            // One residual at a time does not fill vectors, so there is no version for each instruction set.
            Some(jacobian) => {
                let dim = F::Variables::DIM;
                for ((factor, r), j) in rows.zip(jacobian.chunks_exact_mut(M * dim)) {
                    let e = F::Variables::differentiate(factor, &variables, j.as_chunks_mut::<1>().0, 0);
                    r.copy_from_slice(noise.whiten(SVector::from(e)).as_slice());
                    noise.whiten_rows(j, dim);
                }
            }
        }
        Ok(())
    }

    fn lanes(&self, group: usize) -> Option<&dyn LaneAccess> {
        (self.row_count(group) >= FEWEST * M).then_some(self)
    }
}

impl<F: Factor<M>, const M: usize> LaneAccess for Batch<F, M> {
    fn evaluate_lanes(
        &self,
        group: usize,
        values: &Values,
        blocks: &mut [Lane],
        jacobian: bool,
    ) -> Result<(), EvaluationError> {
        let factors = &self.factors[self.start(group)..self.groups[group].end];
        let variables = self.variables_of(group, values)?;
        Arch::new().dispatch(LaneEvaluation { factors, variables, noise: &self.noise, blocks, jacobian });
        Ok(())
    }
}

/// The evaluation of one group, up to [`LANES`] factors at a time.
struct LaneEvaluation<'a, F: Factor<M>, const M: usize> {
    factors: &'a [F],
    variables: Borrowed<'a, F::Variables>,
    noise: &'a Noise<M>,
    blocks: &'a mut [Lane],
    jacobian: bool,
}

impl<F: Factor<M>, const M: usize> WithSimd for LaneEvaluation<'_, F, M> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { factors, variables, noise, blocks, jacobian } = self;
        // Copies, so that the compiler knows that what is written does not change them.
        let copies = F::Variables::copies(&variables);
        let variables = copies.references();
        if jacobian {
            let blocks = blocks.chunks_exact_mut(M + M * F::Variables::DIM);
            for (chunk, block) in factors.chunks(LANES).zip(blocks) {
                clear_last(block, chunk.len());
                let (residuals, entries) = block.split_at_mut(M);
                linearize_block(chunk, &variables, residuals, entries);
                noise.whiten_lanes(residuals, chunk.len());
                noise.whiten_lanes(entries, chunk.len());
            }
        } else {
            for (chunk, block) in factors.chunks(LANES).zip(blocks.chunks_exact_mut(M)) {
                clear_last(block, chunk.len());
                evaluate_block(chunk, &variables, block);
                noise.whiten_lanes(block, chunk.len());
            }
        }
    }
}

#[inline(always)]
fn evaluate_block<F: Factor<M>, const M: usize>(
    factors: &[F],
    variables: &Borrowed<'_, F::Variables>,
    residuals: &mut [Lane],
) {
    for l in 0..factors.len().min(LANES) {
        let r = value(&factors[l], variables);
        unrolled!(m < M => {
            residuals[m][l] = r[m];
        });
    }
}

#[inline(always)]
fn linearize_block<F: Factor<M>, const M: usize>(
    factors: &[F],
    variables: &Borrowed<'_, F::Variables>,
    residuals: &mut [Lane],
    entries: &mut [Lane],
) {
    for l in 0..factors.len().min(LANES) {
        let r = F::Variables::differentiate(&factors[l], variables, entries, l);
        unrolled!(m < M => {
            residuals[m][l] = r[m];
        });
    }
}

/// Sets the last eight numbers to zero of which some are `used`.
#[inline(always)]
fn clear_last(block: &mut [Lane], used: usize) {
    for lane in block {
        if let Some(last) = lane[used / 8 * 8..].first_chunk_mut::<8>() {
            *last = [0.0; 8];
        }
    }
}
