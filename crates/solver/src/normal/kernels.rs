//! Dense kernels for small matrices, all row-major.

use faer::linalg::matmul::triangular::{BlockStructure, matmul};
use faer::{Accum, MatMut, MatRef, Par};

/// A ← lower triangle of JᵀJ, for J of `rows` × `m` and A of m × m. For many rows.
pub(crate) fn gram_lower(j: &[f64], rows: usize, m: usize, a: &mut [f64]) {
    let j = MatRef::from_row_major_slice(&j[..rows * m], rows, m);
    matmul(
        MatMut::from_row_major_slice_mut(&mut a[..m * m], m, m),
        BlockStructure::TriangularLower,
        Accum::Replace,
        j.transpose(),
        BlockStructure::Rectangular,
        j,
        BlockStructure::Rectangular,
        1.0,
        Par::Seq,
    );
}

/// g ← Jᵀr, for J of rows × `m`, r of length rows and g of length m.
pub(crate) fn gram_vector(j: &[f64], r: &[f64], m: usize, g: &mut [f64]) {
    g[..m].fill(0.0);
    for (row, r) in j.chunks_exact(m).zip(r) {
        for (g, x) in g[..m].iter_mut().zip(row) {
            *g += x * r;
        }
    }
}

/// Cholesky factorisation A = L Lᵀ of an n × n matrix, in place in the lower triangle; false if a pivot is not positive.
#[must_use]
pub(crate) fn cholesky(a: &mut [f64], n: usize) -> bool {
    for i in 0..n {
        let (above, row) = a.split_at_mut(i * n);
        for j in 0..i {
            let other = &above[j * n..j * n + j + 1];
            let dot: f64 = row[..j].iter().zip(other).map(|(x, y)| x * y).sum();
            row[j] = (row[j] - dot) / other[j];
        }
        let dot: f64 = row[..i].iter().map(|x| x * x).sum();
        let pivot = row[i] - dot;
        if !(pivot > 0.0 && pivot.is_finite()) {
            return false;
        }
        row[i] = pivot.sqrt();
    }
    true
}

/// X ← L⁻¹ X for L of n × n and X of n × `width`.
pub(crate) fn solve_lower(l: &[f64], n: usize, x: &mut [f64], width: usize) {
    if width == 0 {
        return;
    }
    for i in 0..n {
        let (above, row) = x.split_at_mut(i * width);
        let row = &mut row[..width];
        for k in 0..i {
            let c = l[i * n + k];
            for (x, y) in row.iter_mut().zip(&above[k * width..]) {
                *x -= c * y;
            }
        }
        let inverse = 1.0 / l[i * n + i];
        row.iter_mut().for_each(|x| *x *= inverse);
    }
}

/// x ← L⁻ᵀ x for L of n × n.
pub(crate) fn solve_lower_transposed(l: &[f64], n: usize, x: &mut [f64]) {
    for i in (0..n).rev() {
        x[i] /= l[i * n + i];
        let (above, from_i) = x.split_at_mut(i);
        for (k, x) in above.iter_mut().enumerate() {
            *x -= l[i * n + k] * from_i[0];
        }
    }
}
