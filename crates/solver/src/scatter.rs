//! A group's products JᵀJ and Jᵀr, and their way into the chunk's blocks.

use pulp::{Simd, WithSimd};

use crate::chunk::Scatter;
use crate::kernels;

/// Room beyond the end that [`SmallProducts`] may touch: one vector of the widest machine.
pub(crate) const PADDING: usize = 8;

/// From this many rows on the general matrix product pays.
const STACKED_ROWS: usize = 24;

/// A group's weighted Jacobian, `rows` × m, row-major, and residuals. The slice of J has [`PADDING`].
#[derive(Clone, Copy)]
pub(crate) struct Rows<'a> {
    pub j: &'a [f64],
    pub r: &'a [f64],
}

/// JᵀJ (lower triangle, m × m) and Jᵀr; what lies above the diagonal is not meaningful. The slice of JᵀJ has [`PADDING`].
#[inline(always)]
fn products<S: Simd>(simd: S, Rows { j, r }: Rows<'_>, m: usize, gram: &mut [f64], gradient: &mut [f64]) {
    match (r.len(), m) {
        // Points in images, with or without what the camera is, and relative poses.
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

#[inline(always)]
fn small_products<S: Simd>(simd: S, j: &[f64], r: &[f64], m: usize, gram: &mut [f64], gradient: &mut [f64]) {
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

/// [`small_products`] for sizes known when compiling.
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

/// t ← xᵀ J up to column `last` at least.
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
    /// What the products are made of, where they are not there yet.
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
