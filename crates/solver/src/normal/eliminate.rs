//! Elimination of a chunk's variables: its part of the Schur complement, and back-substitution.
//!
//! With H_ee + μ D² = L Lᵀ and W = L⁻¹ [H_ec g_e], an eliminated variable's part is Wᵀ W, whose last row is that of the
//! right-hand side.

use pulp::{Simd, WithSimd};

use crate::normal::kernels;
use crate::plan::chunk_plan::{ChunkPlan, Elimination, QUAD, Strip};

/// Factorises every H_ee + μ D² and sums Wᵀ W. The output is whether all were positive definite. The buffers are
/// those of the chunk.
pub(crate) struct Eliminate<'a> {
    pub plan: &'a ChunkPlan,
    pub hee: &'a [f64],
    pub hec: &'a [f64],
    pub ge: &'a [f64],
    pub mu: f64,
    /// Diagonal of D² for the chunk's eliminated variables.
    pub d2: &'a [f64],
    pub lee: &'a mut [f64],
    pub scc: &'a mut [f64],
    pub sc: &'a mut [f64],
    /// Sums Wᵀ W of strips that many variables have in common.
    pub dense: &'a mut [f64],
    /// Scratch: W of one variable, d × stride.
    pub w: &'a mut [f64],
}

impl WithSimd for Eliminate<'_> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) -> bool {
        self.scc.fill(0.0);
        self.sc.fill(0.0);
        self.dense.fill(0.0);
        for e in &self.plan.eliminations {
            // The usual dimensions are constants in code of their own, so that loops over them are unrolled.
            let definite = match e.d {
                1 => self.eliminate::<S, 1>(simd, e),
                2 => self.eliminate::<S, 2>(simd, e),
                3 => self.eliminate::<S, 3>(simd, e),
                6 => self.eliminate::<S, 6>(simd, e),
                _ => self.eliminate_any(simd, e),
            };
            if !definite {
                return false;
            }
        }
        self.distribute();
        true
    }
}

impl Eliminate<'_> {
    /// Eliminates a variable of dimension D; false if its H_ee + μ D² is not positive definite.
    #[inline(always)]
    fn eliminate<S: Simd, const D: usize>(&mut self, simd: S, e: &Elimination) -> bool {
        let strip = &self.plan.strips[e.strip as usize];
        let stride = strip.stride as usize;
        let Some(h) = self.hee[e.ee..].as_chunks::<D>().0.first_chunk::<D>() else { return false };
        let mut l = *h;
        let mut inverse = [0.0; D];
        for i in 0..D {
            l[i][i] += self.mu * self.d2[e.e + i];
            for j in 0..i {
                let mut x = l[i][j];
                for k in 0..j {
                    x -= l[i][k] * l[j][k];
                }
                l[i][j] = x * inverse[j];
            }
            let mut pivot = l[i][i];
            for k in 0..i {
                pivot -= l[i][k] * l[i][k];
            }
            if !(pivot > 0.0 && pivot.is_finite()) {
                return false;
            }
            l[i][i] = pivot.sqrt();
            inverse[i] = 1.0 / l[i][i];
        }
        self.lee[e.ee..][..D * D].copy_from_slice(l.as_flattened());
        if strip.width == 0 {
            return true;
        }
        let w = &mut self.w[..D * stride];
        load(w, stride, strip.width as usize, &self.hec[e.ec..], &self.ge[e.e..][..D]);
        for column in (0..stride).step_by(QUAD) {
            let mut x = [[0.0; QUAD]; D];
            for i in 0..D {
                let Some(quad) = w[i * stride + column..].first_chunk::<QUAD>() else { continue };
                x[i] = *quad;
                for k in 0..i {
                    for q in 0..QUAD {
                        x[i][q] -= l[i][k] * x[k][q];
                    }
                }
                for q in 0..QUAD {
                    x[i][q] *= inverse[i];
                }
                w[i * stride + column..][..QUAD].copy_from_slice(&x[i]);
            }
        }
        match strip.dense {
            Some(dense) => {
                let target = &mut self.dense[dense as usize..][..stride * stride];
                product::<D>(w, stride, strip.width as usize + 1, target);
            }
            None => self.add_pairs::<S, D>(simd, e, 0),
        }
        true
    }

    /// Eliminates a variable of any dimension.
    #[inline(always)]
    fn eliminate_any<S: Simd>(&mut self, simd: S, e: &Elimination) -> bool {
        let d = e.d as usize;
        let strip = &self.plan.strips[e.strip as usize];
        let stride = strip.stride as usize;
        let l = &mut self.lee[e.ee..][..d * d];
        l.copy_from_slice(&self.hee[e.ee..][..d * d]);
        for i in 0..d {
            l[i * d + i] += self.mu * self.d2[e.e + i];
        }
        if !kernels::cholesky(l, d) {
            return false;
        }
        if strip.width > 0 {
            let w = &mut self.w[..d * stride];
            load(w, stride, strip.width as usize, &self.hec[e.ec..], &self.ge[e.e..][..d]);
            kernels::solve_lower(l, d, w, stride);
            (0..d).for_each(|k| self.add_pairs::<S, 1>(simd, e, k));
        }
        true
    }

    /// Adds Wᵀ W of the D rows of W from `first` on to `scc` and `sc`, block by block.
    #[inline(always)]
    fn add_pairs<S: Simd, const D: usize>(&mut self, simd: S, e: &Elimination, first: usize) {
        let strip = &self.plan.strips[e.strip as usize];
        let (width, stride) = (strip.width as usize, strip.stride as usize);
        let w = &self.w[first * stride..][..D * stride];
        let mut pairs = strip.pairs.iter();
        for (k, row) in strip.variables.iter().enumerate() {
            let (i, di) = (row.column as usize, row.d as usize);
            for column in &strip.variables[..=k] {
                let (j, dj) = (column.column as usize, column.d as usize);
                let Some(offset) = pairs.next() else { continue };
                let block = &mut self.scc[*offset as usize..][..di * dj];
                // Sizes of poses, and of cameras with pose, focal length and distortion.
                match (di, dj) {
                    (6, 6) => square::<S, D, 6>(simd, w, stride, (i, j), block),
                    (9, 9) => square::<S, D, 9>(simd, w, stride, (i, j), block),
                    _ => pair::<S, D>(simd, w, stride, i, (j, dj), block),
                }
            }
            let target = &mut self.sc[row.local as usize..][..di];
            for w in w.chunks_exact(stride) {
                target.iter_mut().zip(&w[i..i + di]).for_each(|(t, x)| *t += x * w[width]);
            }
        }
    }

    /// Adds the sums over common strips to `scc` and `sc`.
    fn distribute(&mut self) {
        for strip in &self.plan.strips {
            let Some(dense) = strip.dense else { continue };
            let (width, stride) = (strip.width as usize, strip.stride as usize);
            let sums = &self.dense[dense as usize..][..stride * stride];
            let mut pairs = strip.pairs.iter();
            for (k, row) in strip.variables.iter().enumerate() {
                let (i, di) = (row.column as usize, row.d as usize);
                for column in &strip.variables[..=k] {
                    let (j, dj) = (column.column as usize, column.d as usize);
                    let Some(offset) = pairs.next() else { continue };
                    for (a, target) in self.scc[*offset as usize..][..di * dj].chunks_exact_mut(dj).enumerate() {
                        let source = &sums[(i + a) * stride + j..][..dj];
                        target.iter_mut().zip(source).for_each(|(t, s)| *t += s);
                    }
                }
                let target = &mut self.sc[row.local as usize..][..di];
                target.iter_mut().zip(&sums[width * stride + i..]).for_each(|(t, s)| *t += s);
            }
        }
    }
}

/// W ← [H_ec g_e], d × `stride`, with g_e in column `width`.
#[inline(always)]
fn load(w: &mut [f64], stride: usize, width: usize, hec: &[f64], ge: &[f64]) {
    w.copy_from_slice(&hec[..w.len()]);
    for (row, g) in w.chunks_exact_mut(stride).zip(ge) {
        row[width] = *g;
    }
}

/// A += Wᵀ W in the first `rows` rows of A, each at least up to its diagonal. W is D × `stride`, A `stride` × `stride`.
#[inline(always)]
fn product<const D: usize>(w: &[f64], stride: usize, rows: usize, a: &mut [f64]) {
    for (i, row) in a.chunks_exact_mut(stride).take(rows).enumerate() {
        let mut x = [0.0; D];
        for k in 0..D {
            x[k] = w[k * stride + i];
        }
        for (c, quad) in row.as_chunks_mut::<QUAD>().0.iter_mut().enumerate().take(i / QUAD + 1) {
            for k in 0..D {
                let Some(y) = w[k * stride + c * QUAD..].first_chunk::<QUAD>() else { continue };
                for q in 0..QUAD {
                    quad[q] += x[k] * y[q];
                }
            }
        }
    }
}

/// B += Wᵢᵀ Wⱼ with Wᵢ the columns of W from `i` on and Wⱼ its `dj` columns from `j` on. W is D × `stride`; B has `dj`
/// columns.
#[inline(always)]
fn pair<S: Simd, const D: usize>(
    simd: S,
    w: &[f64],
    stride: usize,
    i: usize,
    (j, dj): (usize, usize),
    block: &mut [f64],
) {
    let lanes = S::F64_LANES;
    let whole = dj - dj % lanes;
    for c in (0..whole).step_by(lanes) {
        let mut y = [simd.splat_f64s(0.0); D];
        for k in 0..D {
            y[k] = S::as_simd_f64s(&w[k * stride + j + c..][..lanes]).0[0];
        }
        for (a, row) in block.chunks_exact_mut(dj).enumerate() {
            let target = &mut S::as_mut_simd_f64s(&mut row[c..][..lanes]).0[0];
            for k in 0..D {
                *target = simd.mul_add_e_f64s(simd.splat_f64s(w[k * stride + i + a]), y[k], *target);
            }
        }
    }
    for c in whole..dj {
        let mut y = [0.0; D];
        for k in 0..D {
            y[k] = w[k * stride + j + c];
        }
        for (a, row) in block.chunks_exact_mut(dj).enumerate() {
            for k in 0..D {
                row[c] += w[k * stride + i + a] * y[k];
            }
        }
    }
}

/// [`pair`] for blocks N × N: loops are unrolled, and columns that do not fill a vector register along a row are processed
/// along the column.
#[inline(always)]
fn square<S: Simd, const D: usize, const N: usize>(
    simd: S,
    w: &[f64],
    stride: usize,
    (i, j): (usize, usize),
    block: &mut [f64],
) {
    let (mut x, mut y) = ([[0.0; N]; D], [[0.0; N]; D]);
    for k in 0..D {
        let row = &w[k * stride..][..stride];
        let (Some(xs), Some(ys)) = (row[i..].first_chunk::<N>(), row[j..].first_chunk::<N>()) else { return };
        (x[k], y[k]) = (*xs, *ys);
    }
    let Some(rows) = block.as_chunks_mut::<N>().0.first_chunk_mut::<N>() else { return };
    let whole = N - N % S::F64_LANES;
    for (a, row) in rows.iter_mut().enumerate() {
        for (v, target) in S::as_mut_simd_f64s(row).0.iter_mut().enumerate() {
            let mut sum = *target;
            for k in 0..D {
                sum = simd.mul_add_e_f64s(simd.splat_f64s(x[k][a]), S::as_simd_f64s(&y[k]).0[v], sum);
            }
            *target = sum;
        }
    }
    for c in whole..N {
        let mut column = [0.0; N];
        for k in 0..D {
            for a in 0..N {
                column[a] += x[k][a] * y[k][c];
            }
        }
        for a in 0..N {
            rows[a][c] += column[a];
        }
    }
}

/// Computes the step of the eliminated variables, −(H_ee + μ D²)⁻¹ (g_e + H_ec δ_c), from that of the kept ones, δ_c.
pub(crate) struct BackSubstitute<'a> {
    pub plan: &'a ChunkPlan,
    pub hec: &'a [f64],
    pub ge: &'a [f64],
    pub lee: &'a [f64],
    pub kept_step: &'a [f64],
    pub step: &'a mut [f64],
}

impl WithSimd for BackSubstitute<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        for e in &self.plan.eliminations {
            let d = e.d as usize;
            let step = &mut self.step[e.e..][..d];
            step.copy_from_slice(&self.ge[e.e..][..d]);
            let strip = &self.plan.strips[e.strip as usize];
            multiply_strip(simd, strip, &self.hec[e.ec..], d, self.kept_step, step);
            let l = &self.lee[e.ee..][..d * d];
            match d {
                3 => solve::<3>(l, step),
                6 => solve::<6>(l, step),
                _ => {
                    kernels::solve_lower(l, d, step, 1);
                    kernels::solve_lower_transposed(l, d, step);
                }
            }
            step.iter_mut().for_each(|s| *s = -*s);
        }
    }
}

/// x ← (L Lᵀ)⁻¹ x for L of D × D.
#[inline(always)]
fn solve<const D: usize>(l: &[f64], x: &mut [f64]) {
    let (Some(l), Some(x)) = (l.as_chunks::<D>().0.first_chunk::<D>(), x.first_chunk_mut::<D>()) else { return };
    for i in 0..D {
        for k in 0..i {
            x[i] -= l[i][k] * x[k];
        }
        x[i] /= l[i][i];
    }
    for i in (0..D).rev() {
        x[i] /= l[i][i];
        for k in 0..i {
            x[k] -= l[i][k] * x[i];
        }
    }
}

/// target += H_ec x for the `d` rows of an eliminated variable's strip; `x` is over all kept variables.
#[inline(always)]
pub(crate) fn multiply_strip<S: Simd>(simd: S, strip: &Strip, hec: &[f64], d: usize, x: &[f64], target: &mut [f64]) {
    let stride = strip.stride as usize;
    if strip.width == 0 {
        return;
    }
    for (row, t) in hec[..d * stride].chunks_exact(stride).zip(target) {
        // Vector lanes are summed separately over all variables, and across lanes at the end.
        let mut sums = simd.splat_f64s(0.0);
        let mut tail = 0.0;
        for v in &strip.variables {
            let (column, dv, offset) = (v.column as usize, v.d as usize, v.kept as usize);
            let (h, h_rest) = S::as_simd_f64s(&row[column..column + dv]);
            let (x, x_rest) = S::as_simd_f64s(&x[offset..offset + dv]);
            for (h, x) in h.iter().zip(x) {
                sums = simd.mul_add_e_f64s(*h, *x, sums);
            }
            for (h, x) in h_rest.iter().zip(x_rest) {
                tail += h * x;
            }
        }
        *t += simd.reduce_sum_f64s(sums) + tail;
    }
}
