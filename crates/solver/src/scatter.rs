//! A group's products JᵀJ and Jᵀr, and their way into the chunk's blocks.

use pulp::{Simd, WithSimd};

use crate::chunk::Scatter;
use crate::kernels;

/// Room beyond the end that [`SmallProducts`] may touch: one vector of the widest machine.
pub(crate) const PADDING: usize = 8;

/// From this many rows on the general matrix product pays.
const STACKED_ROWS: usize = 24;

/// JᵀJ (lower triangle, m × m) and Jᵀr of `rows` × m, row-major; what lies above the diagonal is not meaningful. The slices
/// of J and JᵀJ have [`PADDING`].
pub(crate) fn products(j: &[f64], r: &[f64], m: usize, gram: &mut [f64], gradient: &mut [f64]) {
    if r.len() >= STACKED_ROWS && m >= 4 {
        kernels::gram_lower(j, r.len(), m, gram);
        kernels::gram_vector(&j[..r.len() * m], r, m, gradient);
    } else {
        pulp::Arch::new().dispatch(SmallProducts { j, r, m, gram, gradient });
    }
}

struct SmallProducts<'a> {
    j: &'a [f64],
    r: &'a [f64],
    m: usize,
    gram: &'a mut [f64],
    gradient: &'a mut [f64],
}

impl WithSimd for SmallProducts<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { j, r, m, gram, gradient } = self;
        let lanes = S::F64_LANES;
        // Whole vectors, whose excess the next row overwrites.
        for i in 0..m {
            for c in (0..=i).step_by(lanes) {
                let mut sum = simd.splat_f64s(0.0);
                for k in 0..r.len() {
                    let y = S::as_simd_f64s(&j[k * m + c..][..lanes]).0[0];
                    sum = simd.mul_add_e_f64s(simd.splat_f64s(j[k * m + i]), y, sum);
                }
                S::as_mut_simd_f64s(&mut gram[i * m + c..][..lanes]).0[0] = sum;
            }
        }
        for c in (0..m).step_by(lanes) {
            let mut sum = simd.splat_f64s(0.0);
            for (k, r) in r.iter().enumerate() {
                let y = S::as_simd_f64s(&j[k * m + c..][..lanes]).0[0];
                sum = simd.mul_add_e_f64s(simd.splat_f64s(*r), y, sum);
            }
            S::as_mut_simd_f64s(&mut gradient[c..][..lanes]).0[0] = sum;
        }
    }
}

/// Blocks of the eliminated variable of a group.
pub(crate) struct EliminatedBlocks<'a> {
    /// First column in the strip of each kept variable.
    pub strip_columns: &'a [u32],
    /// H_ee, d × d.
    pub hee: &'a mut [f64],
    /// H_ec, d × stride.
    pub hec: &'a mut [f64],
    pub ge: &'a mut [f64],
}

/// Adds a group's products to the blocks.
pub(crate) struct Add<'a> {
    pub scatter: &'a Scatter,
    pub gram: &'a [f64],
    pub gradient: &'a [f64],
    pub eliminated: Option<EliminatedBlocks<'a>>,
    pub hcc: &'a mut [f64],
    pub gc: &'a mut [f64],
}

impl WithSimd for Add<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { scatter, gram, gradient, eliminated, hcc, gc } = self;
        let m = scatter.m as usize;
        if let Some(blocks) = eliminated {
            add_eliminated(simd, scatter, gram, gradient, blocks);
        }
        for variable in &scatter.kept {
            let (column, d) = (variable.column as usize, variable.d as usize);
            add(simd, &mut gc[variable.local as usize..][..d], &gradient[column..]);
        }
        for pair in &scatter.pairs {
            let (row, dr) = (pair.row as usize, pair.row_d as usize);
            let (column, dc) = (pair.column as usize, pair.column_d as usize);
            let block = &mut hcc[pair.block as usize..][..dr * dc];
            if row >= column {
                // Above the diagonal of a diagonal block numbers have no meaning and are not used: whole rows are quicker.
                for (a, target) in block.chunks_exact_mut(dc).enumerate() {
                    add(simd, target, &gram[(row + a) * m + column..]);
                }
            } else {
                for (a, target) in block.chunks_exact_mut(dc).enumerate() {
                    for (b, t) in target.iter_mut().enumerate() {
                        *t += gram[(column + b) * m + row + a];
                    }
                }
            }
        }
    }
}

#[inline(always)]
fn add_eliminated<S: Simd>(simd: S, scatter: &Scatter, gram: &[f64], gradient: &[f64], blocks: EliminatedBlocks<'_>) {
    let Some((first, d)) = scatter.eliminated else { return };
    let (first, d, m) = (first as usize, d as usize, scatter.m as usize);
    let EliminatedBlocks { strip_columns, hee, hec, ge } = blocks;
    let stride = hec.len() / d;
    for i in 0..d {
        let source = &gram[(first + i) * m + first..][..=i];
        hee[i * d..=i * d + i].iter_mut().zip(source).for_each(|(t, s)| *t += s);
        ge[i] += gradient[first + i];
    }
    for (variable, column) in scatter.kept.iter().zip(strip_columns) {
        let (own, dv, column) = (variable.column as usize, variable.d as usize, *column as usize);
        for i in 0..d {
            let target = &mut hec[i * stride + column..][..dv];
            if own < first {
                add(simd, target, &gram[(first + i) * m + own..]);
            } else {
                for (a, t) in target.iter_mut().enumerate() {
                    *t += gram[(own + a) * m + first + i];
                }
            }
        }
    }
}

/// t += s, over the length of t.
#[inline(always)]
pub(crate) fn add<S: Simd>(simd: S, t: &mut [f64], s: &[f64]) {
    let (s, s_rest) = S::as_simd_f64s(&s[..t.len()]);
    let (t, t_rest) = S::as_mut_simd_f64s(t);
    for (t, s) in t.iter_mut().zip(s) {
        *t = simd.add_f64s(*t, *s);
    }
    // Loads and stores of parts of a vector cost more than a few numbers one by one.
    t_rest.iter_mut().zip(s_rest).for_each(|(t, s)| *t += s);
}
