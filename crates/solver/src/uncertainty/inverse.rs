//! The (pseudo-)inverse of the normal equations, by blocks.
//!
//! With P = H_ee⁺ (block-diagonal), T = −P H_ec and S = H_cc + H_ce T, the matrix
//! G = [P + T S⁺ Tᵀ, T S⁺; S⁺ Tᵀ, S⁺] is a generalised inverse of a positive semidefinite H, and its inverse if H is
//! regular. With N an orthonormal basis of the null space of H, (I − N Nᵀ) G (I − N Nᵀ) is its Moore–Penrose inverse.

use std::sync::Arc;

use faer::{Mat, Side};
use nalgebra::{DMatrix, DVector, SymmetricEigen};

use crate::normal::normal_equations::NormalEquations;
use crate::plan::layout::{Active, Layout};
use crate::uncertainty::gram_schmidt::orthonormalize;

/// The blocks of an eliminated variable.
#[derive(Clone)]
struct Eliminated {
    /// P, d × d.
    p: DMatrix<f64>,
    /// T, d × width of its strip.
    t: DMatrix<f64>,
    /// For each variable of the strip its offset among the kept components, its first column in the strip, and its
    /// dimension.
    columns: Arc<[(usize, usize, usize)]>,
}

#[derive(Clone)]
pub(crate) struct Inverse {
    eliminated: Vec<Eliminated>,
    /// S⁺.
    s: DMatrix<f64>,
    /// Orthonormal basis N of the null space, eliminated variables first.
    pub null: Vec<DVector<f64>>,
    /// G N and Nᵀ G N.
    g_null: Vec<DVector<f64>>,
    null_g_null: DMatrix<f64>,
}

impl Inverse {
    /// Inverts linearised normal equations; `None` if eigenvalues are not found. Eigenvalues up to `tolerance` count as
    /// zero.
    pub fn new(system: &NormalEquations, tolerance: f64) -> Option<Self> {
        let layout = &system.layout;
        let split = layout.eliminated_dim;
        let mut s = system.kept_hessian();
        let diagonal = s.diagonal();
        let mut eliminated = Vec::with_capacity(layout.eliminated.len());
        let mut null = Vec::new();
        for chunk in &system.chunks {
            let strips: Vec<Arc<[(usize, usize, usize)]>> = chunk
                .plan
                .strips
                .iter()
                .map(|s| s.variables.iter().map(|v| (v.kept as usize, v.column as usize, v.d as usize)).collect())
                .collect();
            for e in &chunk.plan.eliminations {
                let strip = &chunk.plan.strips[e.strip as usize];
                let (d, width, stride) = (e.d as usize, strip.width as usize, strip.stride as usize);
                let h = DMatrix::from_fn(d, d, |i, j| chunk.hee[e.ee + i.max(j) * d + i.min(j)]);
                let (p, vectors) = pseudo_inverse_small(&h, tolerance)?;
                for v in vectors {
                    let mut full = DVector::zeros(layout.dim());
                    full.rows_mut(chunk.plan.offset + e.e, d).copy_from(&v);
                    null.push(full);
                }
                let hec = DMatrix::from_fn(d, width, |i, j| chunk.hec[e.ec + i * stride + j]);
                let t = -(&p * &hec);
                let update = hec.tr_mul(&t);
                let columns = Arc::clone(&strips[e.strip as usize]);
                for (row, i, di) in columns.iter().copied() {
                    for (column, j, dj) in columns.iter().copied() {
                        let mut target = s.view_mut((row, column), (di, dj));
                        target += update.view((i, j), (di, dj));
                    }
                }
                eliminated.push(Eliminated { p, t, columns });
            }
        }
        let (s, vectors) = pseudo_inverse(&s, &diagonal, tolerance)?;
        let mut inverse =
            Self { eliminated, s, null: Vec::new(), g_null: Vec::new(), null_g_null: DMatrix::zeros(0, 0) };
        for v in vectors {
            let mut full = DVector::zeros(layout.dim());
            full.rows_mut(split, v.len()).copy_from(&v);
            inverse.extend_by_elimination(layout, &mut full);
            null.push(full);
        }
        orthonormalize(&mut null);
        inverse.null = null;
        inverse.g_null = inverse.null.iter().map(|v| inverse.apply(layout, v)).collect();
        let k = inverse.null.len();
        inverse.null_g_null = DMatrix::from_fn(k, k, |i, j| inverse.null[i].dot(&inverse.g_null[j]));
        Some(inverse)
    }

    /// x_e ← T x_c.
    fn extend_by_elimination(&self, layout: &Layout, x: &mut DVector<f64>) {
        for (e, a) in self.eliminated.iter().zip(&layout.eliminated) {
            let active = &layout.active[*a as usize];
            for i in 0..active.free as usize {
                let mut sum = 0.0;
                for (first, column, d) in e.columns.iter().copied() {
                    sum += (0..d).map(|k| e.t[(i, column + k)] * x[layout.eliminated_dim + first + k]).sum::<f64>();
                }
                x[active.offset + i] = sum;
            }
        }
    }

    /// G x.
    fn apply(&self, layout: &Layout, x: &DVector<f64>) -> DVector<f64> {
        let split = layout.eliminated_dim;
        let mut x_kept = x.rows(split, layout.kept_dim).into_owned();
        for (e, a) in self.eliminated.iter().zip(&layout.eliminated) {
            let active = &layout.active[*a as usize];
            let part = e.t.tr_mul(&x.rows(active.offset, active.free as usize));
            for (first, column, d) in e.columns.iter().copied() {
                (0..d).for_each(|k| x_kept[first + k] += part[column + k]);
            }
        }
        let y_kept = &self.s * x_kept;
        let mut y = DVector::zeros(layout.dim());
        y.rows_mut(split, layout.kept_dim).copy_from(&y_kept);
        self.extend_by_elimination(layout, &mut y);
        for (e, a) in self.eliminated.iter().zip(&layout.eliminated) {
            let active = &layout.active[*a as usize];
            let d = active.free as usize;
            let of_itself = &e.p * x.rows(active.offset, d);
            let mut target = y.rows_mut(active.offset, d);
            target += of_itself;
        }
        y
    }

    /// The block of the (pseudo-)inverse for two variables.
    pub fn block(&self, layout: &Layout, a: &Active, b: &Active) -> DMatrix<f64> {
        let mut block = self.map_left(a, self.map_right(layout, a, b));
        if a.eliminated && b.eliminated && a.rank == b.rank {
            block += &self.eliminated[a.rank as usize].p;
        }
        if !self.null.is_empty() {
            let rows =
                |v: &[DVector<f64>], x: &Active| DMatrix::from_fn(x.free as usize, v.len(), |i, k| v[k][x.offset + i]);
            let (na, nb) = (rows(&self.null, a), rows(&self.null, b));
            let (ga, gb) = (rows(&self.g_null, a), rows(&self.g_null, b));
            block -= &na * gb.transpose();
            block -= ga * nb.transpose();
            block += na * &self.null_g_null * nb.transpose();
        }
        block
    }

    /// The rows of S⁺ that [`map_left`](Self::map_left) needs for variable `a`, times T_bᵀ or the unit columns of `b`.
    fn map_right(&self, layout: &Layout, a: &Active, b: &Active) -> DMatrix<f64> {
        let rows: Vec<(usize, usize)> = if a.eliminated {
            self.eliminated[a.rank as usize].columns.iter().map(|(first, _, d)| (*first, *d)).collect()
        } else {
            vec![(a.offset - layout.eliminated_dim, a.free as usize)]
        };
        let height = rows.iter().map(|r| r.1).sum();
        let mut result = DMatrix::zeros(height, b.free as usize);
        let mut top = 0;
        for (row, d) in rows {
            let mut target = result.rows_mut(top, d);
            if b.eliminated {
                let e = &self.eliminated[b.rank as usize];
                for (first, column, dc) in e.columns.iter().copied() {
                    target += self.s.view((row, first), (d, dc)) * e.t.columns(column, dc).transpose();
                }
            } else {
                let offset = b.offset - layout.eliminated_dim;
                target.copy_from(&self.s.view((row, offset), (d, b.free as usize)));
            }
            top += d;
        }
        result
    }

    /// `right` multiplied from the left by T_a, or by the unit rows of `a` if `a` is kept.
    fn map_left(&self, a: &Active, right: DMatrix<f64>) -> DMatrix<f64> {
        if a.eliminated { &self.eliminated[a.rank as usize].t * right } else { right }
    }
}

/// The pseudo-inverse of a small symmetric matrix and its null vectors.
fn pseudo_inverse_small(h: &DMatrix<f64>, tolerance: f64) -> Option<(DMatrix<f64>, Vec<DVector<f64>>)> {
    let scale = unit_scale(&h.diagonal());
    let eigen = SymmetricEigen::try_new(scaled(h, &scale), f64::EPSILON, 0)?;
    Some(invert_spectrum(&scale, eigen.eigenvalues.as_slice(), tolerance, |i, k| eigen.eigenvectors[(i, k)]))
}

/// The pseudo-inverse of S and its null vectors. `diagonal` is that of H_cc: eigenvalues are judged relative to the
/// curvatures before elimination.
fn pseudo_inverse(
    s: &DMatrix<f64>,
    diagonal: &DVector<f64>,
    tolerance: f64,
) -> Option<(DMatrix<f64>, Vec<DVector<f64>>)> {
    let n = s.nrows();
    if n == 0 {
        return Some((DMatrix::zeros(0, 0), Vec::new()));
    }
    let scale = unit_scale(diagonal);
    let matrix = Mat::from_fn(n, n, |i, j| s[(i.max(j), i.min(j))] * scale[i] * scale[j]);
    let eigen = matrix.self_adjoint_eigen(Side::Lower).ok()?;
    let values: Vec<f64> = (0..n).map(|i| eigen.S()[i]).collect();
    let vectors = eigen.U();
    Some(invert_spectrum(&scale, &values, tolerance, |i, k| vectors[(i, k)]))
}

/// Scale factors that give a matrix with this diagonal a unit diagonal.
fn unit_scale(diagonal: &DVector<f64>) -> DVector<f64> {
    diagonal.map(|h| if h > 0.0 { 1.0 / h.sqrt() } else { 1.0 })
}

fn scaled(h: &DMatrix<f64>, scale: &DVector<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(h.nrows(), h.ncols(), |i, j| h[(i, j)] * scale[i] * scale[j])
}

/// The pseudo-inverse and the null vectors of a matrix from the eigenvalues and eigenvectors of the scaled matrix;
/// `vector(i, k)` is element i of eigenvector k.
fn invert_spectrum(
    scale: &DVector<f64>,
    values: &[f64],
    tolerance: f64,
    vector: impl Fn(usize, usize) -> f64,
) -> (DMatrix<f64>, Vec<DVector<f64>>) {
    let n = values.len();
    let (good, bad): (Vec<usize>, Vec<usize>) = (0..n).partition(|k| values[*k] > tolerance);
    let half = DMatrix::from_fn(n, good.len(), |i, k| scale[i] * vector(i, good[k]) / values[good[k]].sqrt());
    let null = bad.into_iter().map(|k| DVector::from_fn(n, |i, _| scale[i] * vector(i, k))).collect();
    (&half * half.transpose(), null)
}
