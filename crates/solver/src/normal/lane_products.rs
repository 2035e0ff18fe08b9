//! Products of columns of the Jacobian of a group in lanes.

use pulp::{Simd, WithSimd};

use crate::plan::layout::NONE;
use crate::problem::lane::{LANES, Lane, used_lanes};

/// An entry of a row of a residual in lanes: a free column of its Jacobian, or the residual itself.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LaneColumn {
    /// Index of its lane in the block.
    entry: u32,
    /// Free column; `NONE` for the residual.
    column: u32,
}

/// Computes JᵀJ and Jᵀr of a group in lanes.
///
/// A column that is zero in a row of all residuals, since the row does not depend on it, is left out of that row's products.
pub(crate) struct LaneProducts<'a> {
    /// Blocks of `dim` · (1 + `columns`) lanes each.
    pub blocks: &'a [Lane],
    /// Residuals of the group. What follows the last one is zero up to the next multiple of eight.
    pub count: usize,
    /// Rows of a residual.
    pub dim: usize,
    /// Columns of the Jacobian.
    pub columns: usize,
    /// The free ones among them, unless all are free.
    pub keep: Option<&'a [u32]>,
    /// Number of free columns.
    pub m: usize,
    /// Scratch with room for m + 1 columns.
    pub present: &'a mut Vec<LaneColumn>,
    /// Lower triangle of JᵀJ, row-major m × m.
    pub gram: &'a mut [f64],
    /// Jᵀr, of length m.
    pub gradient: &'a mut [f64],
}

/// Rows and columns of the tile of products that is summed in registers.
const TILE: (usize, usize) = (2, 4);

impl WithSimd for LaneProducts<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { blocks, count, dim, columns: width, keep, m, present, gram, gradient } = self;
        let size = dim * (1 + width);
        let blocks = Blocks { lanes: blocks, size, count };
        gram.fill(0.0);
        gradient.fill(0.0);
        for row in 0..dim {
            present.clear();
            let first = (dim + row * width) as u32;
            for column in 0..m as u32 {
                let entry = first + keep.map_or(column, |keep| keep[column as usize]);
                if blocks.is_present(simd, entry as usize) {
                    present.push(LaneColumn { entry, column });
                }
            }
            present.push(LaneColumn { entry: row as u32, column: NONE });
            let columns = present.as_slice();
            let last = columns.len() - 1;
            for i in (0..columns.len()).step_by(TILE.0) {
                let row: [usize; TILE.0] = [i, (i + 1).min(last)];
                let a = row.map(|i| columns[i].entry as usize);
                for j in (0..=row[1]).step_by(TILE.1) {
                    let column = [j, (j + 1).min(last), (j + 2).min(last), (j + 3).min(last)];
                    let b = column.map(|j| columns[j].entry as usize);
                    let sums = blocks.tile(simd, a, b);
                    for (di, sums) in sums.iter().enumerate().take(columns.len() - i) {
                        for (dj, sum) in sums.iter().enumerate().take(i + di + 1 - j.min(i + di + 1)) {
                            if i + di < last {
                                gram[columns[i + di].column as usize * m + columns[j + dj].column as usize] += sum;
                            } else if j + dj < last {
                                gradient[columns[j + dj].column as usize] += sum;
                            }
                        }
                    }
                }
            }
        }
    }
}

#[derive(Clone, Copy)]
struct Blocks<'a> {
    lanes: &'a [Lane],
    size: usize,
    count: usize,
}

impl<'a> Blocks<'a> {
    /// The blocks with their numbers of vectors.
    #[inline(always)]
    fn iter<S: Simd>(self) -> impl Iterator<Item = (&'a [Lane], usize)> {
        let firsts = (0..self.count).step_by(LANES);
        let vectors = firsts.map(move |first| used_lanes(self.count, first).div_ceil(S::F64_LANES));
        self.lanes.chunks_exact(self.size).zip(vectors)
    }

    /// Whether an entry differs from zero anywhere, which what is not a number does.
    #[inline(always)]
    fn is_present<S: Simd>(self, simd: S, entry: usize) -> bool {
        if self.lanes.get(entry).is_some_and(|lane| lane[0] != 0.0) {
            return true;
        }
        let mut sum = simd.splat_f64s(0.0);
        for (block, vectors) in self.iter::<S>() {
            for lanes in &S::as_simd_f64s(&block[entry]).0[..vectors] {
                sum = simd.add_f64s(sum, simd.abs_f64s(*lanes));
            }
        }
        simd.reduce_sum_f64s(sum) != 0.0
    }

    /// Dot products, over all blocks, of two entries with four entries.
    #[inline(always)]
    fn tile<S: Simd>(self, simd: S, a: [usize; 2], b: [usize; 4]) -> [[f64; 4]; 2] {
        let mut sums = [[simd.splat_f64s(0.0); 4]; 2];
        for (block, vectors) in self.iter::<S>() {
            let lanes = |i: usize| &S::as_simd_f64s(&block[i]).0[..vectors];
            let (a0, a1) = (lanes(a[0]), lanes(a[1]));
            let (b0, b1, b2, b3) = (lanes(b[0]), lanes(b[1]), lanes(b[2]), lanes(b[3]));
            for v in 0..vectors {
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
}
