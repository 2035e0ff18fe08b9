//! Groups of many like residuals, evaluated eight at a time.
//!
//! Where all residuals of a group depend on the same variables, like the points of a frame on its pose and the camera, the
//! same operations are done for each. Side by side in lanes they become vector instructions, also when derivatives come
//! from dual numbers, and products of columns of the Jacobian become dot products over contiguous memory.

use pulp::{Arch, Simd, WithSimd};

use crate::error::EvaluationError;
use crate::graph::FactorBatch;
use crate::loss::Loss;
use crate::values::{Values, VariableId};

/// Residuals side by side in a block.
pub const LANES: usize = 8;

/// One number of each of the residuals of a block.
pub type Lane = [f64; LANES];

/// Residuals of M rows with E entries of the Jacobian that may differ from zero, in groups that share their variables.
///
/// [`Lanes`] makes a [`FactorBatch`] of it. The functions that work on blocks should be `#[inline(always)]` and consist of
/// one loop `for l in 0..LANES` over straight code without calls and branches on data: it is compiled for the widest vector
/// instructions of the machine it runs on.
///
/// Dual numbers are straight code if everything around them is inlined, which closures are not reliably.
pub trait LaneBatch<const M: usize, const E: usize>: Send + Sync + 'static {
    /// For each row of a residual the columns, ascending, of the Jacobian's entries that may differ from zero; E in all. A
    /// column counts tangent components in the order of [`variables`](Self::variables).
    const PATTERN: [&'static [u32]; M];

    /// What the residuals of a group share, computed once per evaluation: a rotation matrix, say.
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

    /// Computes what the group's residuals share.
    ///
    /// # Errors
    /// If the residuals do not exist at these values.
    fn share(&self, group: usize, values: &Values) -> Result<Self::Shared, EvaluationError>;

    /// Writes the whitened residuals `LANES · block`, … of the group. What is written beyond the group's last residual is
    /// ignored.
    fn residuals(&self, group: usize, shared: &Self::Shared, block: usize, residuals: &mut [Lane; M]);

    /// Writes residuals and the entries of their Jacobian, row after row as in [`PATTERN`](Self::PATTERN).
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
    /// A pattern that does not have E entries in ascending order in each row does not compile.
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

/// Access to batches in lanes for the solver; [`Lanes`] implements it.
///
/// Blocks lie one after the other; in each, the M rows of the residuals come first, then the entries of the Jacobian.
pub trait LaneAccess {
    /// Columns of the entries, for each row.
    fn pattern(&self) -> &[&'static [u32]];

    /// Writes the blocks of a group.
    ///
    /// # Errors
    /// If the residuals do not exist at these values.
    fn evaluate_lanes(
        &self,
        group: usize,
        values: &Values,
        blocks: &mut [Lane],
        jacobian: bool,
    ) -> Result<(), EvaluationError>;
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
                let Some((residuals, rest)) = block.split_first_chunk_mut() else { continue };
                let Some(entries) = rest.first_chunk_mut() else { continue };
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

/// A column of a row's Jacobian, or the residual as the last of them, and where its products go.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LaneColumn {
    /// Position in the block.
    pub entry: u32,
    /// Free column; `NONE` for the residual.
    pub column: u32,
}

/// JᵀJ (lower triangle, m × m), Jᵀ r and ½ ‖r‖² of blocks of `size` lanes each, where lanes beyond the last residual are
/// zero.
pub(crate) struct LaneProducts<'a> {
    pub blocks: &'a [Lane],
    pub size: usize,
    /// For each row the free columns, then the residual.
    pub rows: &'a [Box<[LaneColumn]>],
    pub m: usize,
    pub gram: &'a mut [f64],
    pub gradient: &'a mut [f64],
}

/// Tile of products that is summed in registers.
const TILE: (usize, usize) = (2, 4);

impl WithSimd for LaneProducts<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f64 {
        let Self { blocks, size, rows, m, gram, gradient } = self;
        gram.fill(0.0);
        gradient.fill(0.0);
        let mut squares = 0.0;
        for columns in rows {
            let last = columns.len() - 1;
            for i in (0..columns.len()).step_by(TILE.0) {
                let row: [usize; TILE.0] = [i, (i + 1).min(last)];
                let a = row.map(|i| columns[i].entry as usize);
                for j in (0..=row[1]).step_by(TILE.1) {
                    let column = [j, (j + 1).min(last), (j + 2).min(last), (j + 3).min(last)];
                    let b = column.map(|j| columns[j].entry as usize);
                    let sums = tile(simd, blocks, size, a, b);
                    for (di, sums) in sums.iter().enumerate().take(columns.len() - i) {
                        for (dj, sum) in sums.iter().enumerate().take(i + di + 1 - j.min(i + di + 1)) {
                            if i + di < last {
                                gram[columns[i + di].column as usize * m + columns[j + dj].column as usize] += sum;
                            } else if j + dj < last {
                                gradient[columns[j + dj].column as usize] += sum;
                            } else {
                                squares += sum;
                            }
                        }
                    }
                }
            }
        }
        0.5 * squares
    }
}

/// Dot products over all blocks of two entries by four entries.
#[inline(always)]
fn tile<S: Simd>(simd: S, blocks: &[Lane], size: usize, a: [usize; 2], b: [usize; 4]) -> [[f64; 4]; 2] {
    let mut sums = [[simd.splat_f64s(0.0); 4]; 2];
    for block in blocks.chunks_exact(size) {
        let lanes = |i: usize| S::as_simd_f64s(&block[i]).0;
        let (a0, a1) = (lanes(a[0]), lanes(a[1]));
        let (b0, b1, b2, b3) = (lanes(b[0]), lanes(b[1]), lanes(b[2]), lanes(b[3]));
        for v in 0..LANES / S::F64_LANES {
            for (sums, a) in sums.iter_mut().zip([a0[v], a1[v]]) {
                sums[0] = simd.mul_add_e_f64s(a, b0[v], sums[0]);
                sums[1] = simd.mul_add_e_f64s(a, b1[v], sums[1]);
                sums[2] = simd.mul_add_e_f64s(a, b2[v], sums[2]);
                sums[3] = simd.mul_add_e_f64s(a, b3[v], sums[3]);
            }
        }
    }
    let [x, y] = sums;
    let total = |s| simd.reduce_sum_f64s(s);
    [[total(x[0]), total(x[1]), total(x[2]), total(x[3])], [total(y[0]), total(y[1]), total(y[2]), total(y[3])]]
}
