//! Blocks of the (pseudo-)inverse of the normal equations for some variables, column by column with a sparse factorisation.
//!
//! If H is singular, components are constrained until it is regular. With G the inverse of the constrained matrix, zero
//! in the rows and columns of constrained components, and N an orthonormal basis of the null space of H, (I − N Nᵀ) G (I
//! − N Nᵀ) is the Moore–Penrose inverse of H.

use nalgebra::{DMatrix, DVector};

use crate::normal::normal_equations::NormalEquations;
use crate::plan::layout::Active;
use crate::uncertainty::gram_schmidt::orthonormalize;
use crate::uncertainty::null_space::null_space;

/// Number of columns that are solved for at once.
const COLUMNS: usize = 32;

#[derive(Clone)]
pub(crate) struct Selected {
    /// For each chosen variable its offset in the step and in `matrix`, and its number of free components; ascending.
    chosen: Vec<(usize, usize, usize)>,
    matrix: DMatrix<f64>,
    /// Orthonormal basis of the null space.
    pub null: Vec<DVector<f64>>,
}

impl Selected {
    /// The blocks of the variables in `chosen`, given by ascending (offset in the step, number of free components), of a
    /// system that eliminates nothing. `None` if H cannot be factorised.
    pub fn new(system: &mut NormalEquations, chosen: &[(usize, usize)], tolerance: f64) -> Option<Self> {
        let n = system.dim();
        let mut null = null_space(system, tolerance)?;
        let constrained = pivots(&null, system.diagonal());
        orthonormalize(&mut null);
        system.constrain_components(&constrained);
        if !system.factorize(0.0, &vec![1.0; n]) {
            return None;
        }
        let mut solve = |rhs: &mut Vec<f64>| {
            rhs.chunks_exact_mut(n).for_each(|column| constrained.iter().for_each(|i| column[*i] = 0.0));
            system.solve_many(rhs);
        };
        // G N.
        let mut g_null: Vec<f64> = null.iter().flat_map(|v| v.iter().copied()).collect();
        if !g_null.is_empty() {
            solve(&mut g_null);
        }
        let components: Vec<usize> = chosen.iter().flat_map(|(first, d)| *first..first + d).collect();
        let k = components.len();
        let mut matrix = DMatrix::zeros(k, k);
        for (part, indices) in components.chunks(COLUMNS).enumerate() {
            let mut rhs = vec![0.0; n * indices.len()];
            indices.iter().enumerate().for_each(|(c, i)| rhs[c * n + i] = 1.0);
            solve(&mut rhs);
            for (c, (i, x)) in indices.iter().zip(rhs.chunks_exact_mut(n)).enumerate() {
                // x = P G P eᵢ with P = I − N Nᵀ.
                for (v, g) in null.iter().zip(g_null.chunks_exact(n)) {
                    x.iter_mut().zip(g).for_each(|(x, g)| *x -= v[*i] * g);
                }
                for v in &null {
                    let along: f64 = v.iter().zip(x.iter()).map(|(v, x)| v * x).sum();
                    x.iter_mut().zip(v.iter()).for_each(|(x, v)| *x -= along * v);
                }
                (0..k).for_each(|row| matrix[(row, part * COLUMNS + c)] = x[components[row]]);
            }
        }
        // Symmetric despite rounding errors.
        for i in 0..k {
            for j in 0..i {
                let mean = 0.5 * (matrix[(i, j)] + matrix[(j, i)]);
                (matrix[(i, j)], matrix[(j, i)]) = (mean, mean);
            }
        }
        let mut first = 0;
        let mut place = |(offset, d): &(usize, usize)| {
            first += d;
            (*offset, first - d, *d)
        };
        Some(Self { chosen: chosen.iter().map(&mut place).collect(), matrix, null })
    }

    /// The block of the inverse for two variables; NaN if one of them was not chosen.
    pub fn block(&self, a: &Active, b: &Active) -> DMatrix<f64> {
        let find = |x: &Active| self.chosen.binary_search_by_key(&x.offset, |c| c.0).ok().map(|i| self.chosen[i]);
        match (find(a), find(b)) {
            (Some((_, row, height)), Some((_, column, width))) => {
                self.matrix.view((row, column), (height, width)).into_owned()
            }
            _ => DMatrix::repeat(a.free as usize, b.free as usize, f64::NAN),
        }
    }
}

/// Components that, when constrained to zero, leave no null space: the pivots of Gaussian elimination of its basis,
/// scaled to units of the residuals.
fn pivots(null: &[DVector<f64>], diagonal: &[f64]) -> Vec<usize> {
    let scale = |i: usize| if diagonal[i] > 0.0 { diagonal[i].sqrt() } else { 1.0 };
    let mut rows: Vec<DVector<f64>> = null.iter().map(|v| DVector::from_fn(v.len(), |i, _| v[i] * scale(i))).collect();
    let mut pivots = Vec::with_capacity(rows.len());
    for _ in 0..rows.len() {
        let largest = rows.iter().enumerate().map(|(r, row)| (r, row.icamax())).max_by(|a, b| {
            let size = |(r, i): &(usize, usize)| rows[*r][*i].abs();
            size(a).total_cmp(&size(b))
        });
        let Some((r, pivot)) = largest else { break };
        let row = rows.swap_remove(r);
        for other in &mut rows {
            let factor = other[pivot] / row[pivot];
            other.axpy(-factor, &row, 1.0);
            other[pivot] = 0.0;
        }
        pivots.push(pivot);
    }
    pivots
}
