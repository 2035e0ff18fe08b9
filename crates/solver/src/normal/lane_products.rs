//! Products of columns of the Jacobian of a group in lanes.

use pulp::{Simd, WithSimd};

use crate::plan::chunk_plan::LaneColumn;
use crate::problem::lane::{LANES, Lane};

/// Computes JᵀJ, Jᵀr and ½ ‖r‖² of a group in lanes. Lanes beyond the group's last residual must be zero.
pub(crate) struct LaneProducts<'a> {
    /// Blocks of `size` lanes each.
    pub blocks: &'a [Lane],
    pub size: usize,
    /// For each row of a residual its free columns, then the residual itself.
    pub rows: &'a [Box<[LaneColumn]>],
    /// Free columns of the group.
    pub m: usize,
    /// Lower triangle of JᵀJ, row-major m × m.
    pub gram: &'a mut [f64],
    /// Jᵀr, of length m.
    pub gradient: &'a mut [f64],
}

/// Rows and columns of the tile of products that is summed in registers.
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

/// Dot products, over all blocks, of two entries with four entries.
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
