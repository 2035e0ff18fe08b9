//! Batches that evaluate eight residuals at a time.
//!
//! Where all residuals of a group depend on the same variables, such as the points of a frame on its pose and the camera,
//! the same operations are done for each of them. With one residual per lane these become vector instructions, also for
//! derivatives from dual numbers, and the entries of JᵀJ become dot products over contiguous memory.

use pulp::{Arch, Simd, WithSimd};

use crate::problem::error::EvaluationError;
use crate::problem::factor_batch::FactorBatch;
use crate::problem::key::VariableId;
use crate::problem::lane::{LANES, Lane, LaneAccess};
use crate::problem::loss::Loss;
use crate::problem::values::Values;

/// A batch that evaluates [`LANES`] residuals at a time. Each residual has M rows, and E entries of its Jacobian may differ
/// from zero. All residuals of a group depend on the same variables.
///
/// Wrapped in [`Lanes`] it is a [`FactorBatch`]. Mark [`residuals`](Self::residuals) and [`linearize`](Self::linearize)
/// `#[inline(always)]` and write each as one loop `for l in 0..LANES` whose body neither branches on data nor calls
/// functions that are not inlined: it is then compiled for the widest vector instructions of the machine that it runs on.
/// Dual numbers meet these conditions; closures are not inlined reliably.
pub trait LaneBatch<const M: usize, const E: usize>: Send + Sync + 'static {
    /// For each of the M rows of a residual the columns, ascending, of the Jacobian's entries that may differ from zero;
    /// E in all. Columns count tangent components in the order of [`variables`](Self::variables).
    const PATTERN: [&'static [u32]; M];

    /// Data shared by the residuals of a group and computed once per evaluation, for instance a rotation matrix.
    type Shared;

    /// Name for reports and errors.
    fn name(&self) -> &str;

    /// Number of groups.
    fn group_count(&self) -> usize;

    /// The variables of a group, each at most once.
    fn variables(&self, group: usize) -> &[VariableId];

    /// Number of residuals of a group.
    fn residual_count(&self, group: usize) -> usize;

    /// The loss of every residual.
    fn loss(&self) -> Loss {
        Loss::Trivial
    }

    /// Computes the data that the group's residuals share.
    ///
    /// # Errors
    /// If the residuals do not exist at these values.
    fn share(&self, group: usize, values: &Values) -> Result<Self::Shared, EvaluationError>;

    /// Writes the whitened residuals `LANES · block`, `LANES · block + 1`, … of the group: lane l of `residuals[m]` is
    /// row m of residual `LANES · block + l`. What is written for residuals beyond the group's last one is ignored.
    fn residuals(&self, group: usize, shared: &Self::Shared, block: usize, residuals: &mut [Lane; M]);

    /// Writes the whitened residuals of a block, as [`residuals`](Self::residuals) does, and the E entries of their
    /// Jacobian, row after row as in [`PATTERN`](Self::PATTERN).
    fn linearize(
        &self,
        group: usize,
        shared: &Self::Shared,
        block: usize,
        residuals: &mut [Lane; M],
        jacobian: &mut [Lane; E],
    );
}

/// A [`LaneBatch`] as a [`FactorBatch`].
#[derive(Clone, Debug)]
pub struct Lanes<B, const M: usize, const E: usize>(B);

impl<B: LaneBatch<M, E>, const M: usize, const E: usize> Lanes<B, M, E> {
    /// Wraps a batch. It does not compile unless each row of the pattern ascends and the pattern has E entries in all.
    pub fn new(batch: B) -> Self {
        const {
            let mut entries = 0;
            let mut row = 0;
            while row < M {
                let columns = B::PATTERN[row];
                let mut i = 1;
                while i < columns.len() {
                    assert!(columns[i - 1] < columns[i], "the columns of a row must ascend");
                    i += 1;
                }
                entries += columns.len();
                row += 1;
            }
            assert!(entries == E, "the pattern must have E entries");
            assert!(M > 0, "a residual has at least one row");
        }
        Self(batch)
    }

    /// The batch.
    pub fn inner(&self) -> &B {
        &self.0
    }
}

struct Evaluation<'a, B: LaneBatch<M, E>, const M: usize, const E: usize> {
    batch: &'a B,
    shared: B::Shared,
    group: usize,
    blocks: &'a mut [Lane],
    jacobian: bool,
}

impl<B: LaneBatch<M, E>, const M: usize, const E: usize> WithSimd for Evaluation<'_, B, M, E> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { batch, shared, group, blocks, jacobian } = self;
        if jacobian {
            for (index, block) in blocks.chunks_exact_mut(M + E).enumerate() {
                let Some((residuals, after)) = block.split_first_chunk_mut() else { continue };
                let Some(entries) = after.first_chunk_mut() else { continue };
                batch.linearize(group, &shared, index, residuals, entries);
            }
        } else {
            for (index, residuals) in blocks.as_chunks_mut().0.iter_mut().enumerate() {
                batch.residuals(group, &shared, index, residuals);
            }
        }
    }
}

impl<B: LaneBatch<M, E>, const M: usize, const E: usize> LaneAccess for Lanes<B, M, E> {
    fn pattern(&self) -> &[&'static [u32]] {
        &B::PATTERN
    }

    fn evaluate_lanes(
        &self,
        group: usize,
        values: &Values,
        blocks: &mut [Lane],
        jacobian: bool,
    ) -> Result<(), EvaluationError> {
        let shared = self.0.share(group, values)?;
        Arch::new().dispatch(Evaluation { batch: &self.0, shared, group, blocks, jacobian });
        Ok(())
    }
}

impl<B: LaneBatch<M, E>, const M: usize, const E: usize> FactorBatch for Lanes<B, M, E> {
    fn name(&self) -> &str {
        self.0.name()
    }

    fn group_count(&self) -> usize {
        self.0.group_count()
    }

    fn variables(&self, group: usize) -> &[VariableId] {
        self.0.variables(group)
    }

    fn row_count(&self, group: usize) -> usize {
        M * self.0.residual_count(group)
    }

    fn residual_dim(&self) -> usize {
        M
    }

    fn loss(&self) -> Loss {
        self.0.loss()
    }

    fn evaluate(
        &self,
        group: usize,
        values: &Values,
        residuals: &mut [f64],
        jacobian: Option<&mut [f64]>,
    ) -> Result<(), EvaluationError> {
        let size = if jacobian.is_some() { M + E } else { M };
        let mut blocks = vec![[0.0; LANES]; residuals.len().div_ceil(M * LANES) * size];
        self.evaluate_lanes(group, values, &mut blocks, jacobian.is_some())?;
        for (i, r) in residuals.chunks_exact_mut(M).enumerate() {
            for (row, r) in r.iter_mut().enumerate() {
                *r = blocks[i / LANES * size + row][i % LANES];
            }
        }
        if let Some(jacobian) = jacobian {
            let columns = jacobian.len() / residuals.len().max(1);
            jacobian.fill(0.0);
            for (i, j) in jacobian.chunks_exact_mut((M * columns).max(1)).enumerate() {
                let entries = &blocks[i / LANES * size + M..];
                let places =
                    B::PATTERN.iter().enumerate().flat_map(|(row, c)| c.iter().map(move |c| (row, *c as usize)));
                for ((row, column), entry) in places.zip(entries) {
                    j[row * columns + column] = entry[i % LANES];
                }
            }
        }
        Ok(())
    }

    fn lanes(&self) -> Option<&dyn LaneAccess> {
        Some(self)
    }
}
