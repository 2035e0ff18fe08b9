//! A group's products JᵀJ and Jᵀr, and their addition to the chunk's blocks.

use pulp::{Simd, WithSimd};

use crate::normal::kernels;
use crate::plan::chunk_plan::Scatter;

/// Elements beyond the end of a buffer that [`small_products`] may read or write: one vector of the widest instruction set.
pub(crate) const PADDING: usize = 8;

/// Number of rows from which the general matrix product is faster.
const STACKED_ROWS: usize = 24;

/// A group's weighted Jacobian J, row-major rows × m and followed by [`PADDING`], and its weighted residuals r.
#[derive(Clone, Copy)]
pub(crate) struct Rows<'a> {
    pub j: &'a [f64],
    pub r: &'a [f64],
}

/// Computes JᵀJ into `gram`, row-major m × m of which only the lower triangle is valid, and Jᵀr into `gradient`, of
/// length m. Both are followed by [`PADDING`].
#[inline(always)]
fn products<S: Simd>(simd: S, Rows { j, r }: Rows<'_>, m: usize, gram: &mut [f64], gradient: &mut [f64]) {
    match (r.len(), m) {
        // Sizes of image points with a pose and a point, or with a camera and a point, and of relative poses.
        (2, 9) => fixed_products::<S, 2, 9>(simd, j, r, gram, gradient),
        (2, 12) => fixed_products::<S, 2, 12>(simd, j, r, gram, gradient),
        (6, 12) => fixed_products::<S, 6, 12>(simd, j, r, gram, gradient),
        (STACKED_ROWS.., 4..) => {
            kernels::gram_lower(j, r.len(), m, gram);
            kernels::gram_vector(&j[..r.len() * m], r, m, gradient);
        }
        _ => small_products(simd, j, r, m, gram, gradient),
    }
}

/// [`products`] for few rows or columns.
#[inline(always)]
fn small_products<S: Simd>(simd: S, j: &[f64], r: &[f64], m: usize, gram: &mut [f64], gradient: &mut [f64]) {
    let lanes = S::F64_LANES;
    // Whole vectors are written; the next row overwrites their excess.
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

/// [`small_products`] for R rows and M columns, known at compile time.
#[inline(always)]
fn fixed_products<S: Simd, const R: usize, const M: usize>(
    simd: S,
    j: &[f64],
    r: &[f64],
    gram: &mut [f64],
    gradient: &mut [f64],
) {
    let (Some(j), Some(r)) = (j.as_chunks::<M>().0.first_chunk::<R>(), r.first_chunk::<R>()) else { return };
    let Some(gram) = gram.as_chunks_mut::<M>().0.first_chunk_mut::<M>() else { return };
    let Some(gradient) = gradient.first_chunk_mut::<M>() else { return };
    for (i, target) in gram.iter_mut().enumerate() {
        fixed_row(simd, j, &std::array::from_fn(|k| j[k][i]), i, target);
    }
    fixed_row(simd, j, r, M - 1, gradient);
}

/// t ← xᵀ J, at least up to column `last`.
#[inline(always)]
fn fixed_row<S: Simd, const R: usize, const M: usize>(
    simd: S,
    j: &[[f64; M]; R],
    x: &[f64; R],
    last: usize,
    t: &mut [f64; M],
) {
    let (head, tail) = S::as_mut_simd_f64s(t);
    for (v, target) in head.iter_mut().enumerate().take(last / S::F64_LANES + 1) {
        let mut sum = simd.splat_f64s(0.0);
        for k in 0..R {
            sum = simd.mul_add_e_f64s(simd.splat_f64s(x[k]), S::as_simd_f64s(&j[k]).0[v], sum);
        }
        *target = sum;
    }
    let first = M - tail.len();
    if last >= first {
        for (c, target) in tail.iter_mut().enumerate() {
            let mut sum = 0.0;
            for k in 0..R {
                sum += x[k] * j[k][first + c];
            }
            *target = sum;
        }
    }
}

/// The blocks of a group's eliminated variable.
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
    /// The Jacobian and residuals, if `gram` and `gradient` are to be computed from them.
    pub rows: Option<Rows<'a>>,
    pub gram: &'a mut [f64],
    pub gradient: &'a mut [f64],
    pub eliminated: Option<EliminatedBlocks<'a>>,
    pub hcc: &'a mut [f64],
    pub gc: &'a mut [f64],
}

impl WithSimd for Add<'_> {
    /// Whether the products are finite.
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> bool {
        let Self { scatter, rows, gram, gradient, eliminated, hcc, gc } = self;
        let m = scatter.m as usize;
        if let Some(rows) = rows {
            products(simd, rows, m, gram, gradient);
        }
        let (gram, gradient) = (&*gram, &*gradient);
        let trace: f64 = (0..m).map(|i| gram[i * m + i]).sum();
        if !trace.is_finite() {
            return false;
        }
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
                // Whole rows are faster; entries above the diagonal of a diagonal block are invalid and never used.
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
        true
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
        let (source, dv, column) = (variable.column as usize, variable.d as usize, *column as usize);
        for i in 0..d {
            let target = &mut hec[i * stride + column..][..dv];
            if source < first {
                add(simd, target, &gram[(first + i) * m + source..]);
            } else {
                for (a, t) in target.iter_mut().enumerate() {
                    *t += gram[(source + a) * m + first + i];
                }
            }
        }
    }
}

/// t += s over the length of t.
#[inline(always)]
pub(crate) fn add<S: Simd>(simd: S, t: &mut [f64], s: &[f64]) {
    let (s, s_rest) = S::as_simd_f64s(&s[..t.len()]);
    let (t, t_rest) = S::as_mut_simd_f64s(t);
    for (t, s) in t.iter_mut().zip(s) {
        *t = simd.add_f64s(*t, *s);
    }
    // Loading and storing parts of a vector costs more than a few scalar additions.
    t_rest.iter_mut().zip(s_rest).for_each(|(t, s)| *t += s);
}
