//! Entries of the inverse of a sparse matrix where its Cholesky factor has entries, by Takahashi's equations.

use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::{solve_lower_triangular_in_place, solve_upper_triangular_in_place};
use faer::{Accum, Mat, MatRef, Par};
use nalgebra::DMatrix;

use crate::normal::reduced_system::Sparse;

/// The entries of Z = (L Lᵀ)⁻¹ in the pattern of L, supernode by supernode (Takahashi, Fagan and Chin 1973; Erisman and Tinney
/// 1975).
///
/// With J the columns of a supernode and R the rows below them, Y = L_RJ L_JJ⁻¹, Z_RJ = −Z_RR Y and
/// Z_JJ = (L_JJ L_JJᵀ)⁻¹ − Yᵀ Z_RJ, where Z_RR lies in the pattern of the supernodes of R, which come later.
#[derive(Clone)]
pub(crate) struct SelectedInverse {
    /// Place of each component in the order of elimination.
    place: Vec<usize>,
    /// Supernode of each place.
    node_of: Vec<u32>,
    nodes: Vec<Node>,
}

#[derive(Clone)]
struct Node {
    start: usize,
    /// Places of R, ascending.
    rows: Vec<usize>,
    /// Z_JJ above Z_RJ.
    z: Mat<f64>,
}

impl Node {
    fn width(&self) -> usize {
        self.z.ncols()
    }

    /// Row of `z` that has a place, if one does.
    fn row(&self, place: usize) -> Option<usize> {
        let width = self.width();
        match place.checked_sub(self.start) {
            Some(row) if row < width => Some(row),
            _ => self.rows.binary_search(&place).ok().map(|row| width + row),
        }
    }
}

impl SelectedInverse {
    /// The entries for a factorised system.
    pub fn new(system: &Sparse) -> Self {
        let mut nodes = Vec::new();
        system.for_each_node(|start, rows, factor| {
            nodes.push(Node { start, rows: rows.to_vec(), z: factor.to_owned() });
        });
        let mut node_of = vec![0; nodes.last().map_or(0, |node| node.start + node.width())];
        for (index, node) in nodes.iter().enumerate() {
            node_of[node.start..node.start + node.width()].fill(index as u32);
        }
        let mut inverse = Self { place: system.places(), node_of, nodes };
        for index in (0..inverse.nodes.len()).rev() {
            let below = inverse.square(&inverse.nodes[index].rows);
            invert(&mut inverse.nodes[index].z, below.as_ref());
        }
        inverse
    }

    /// Z_RR.
    fn square(&self, rows: &[usize]) -> Mat<f64> {
        let mut z = Mat::zeros(rows.len(), rows.len());
        let mut first = 0;
        let mut places = Vec::with_capacity(rows.len());
        while first < rows.len() {
            let node = &self.nodes[self.node_of[rows[first]] as usize];
            let end = node.start + node.width();
            let last = first + rows[first..].iter().take_while(|row| **row < end).count();
            // Rows from here on are all in this supernode, in the same order.
            places.clear();
            let mut below = 0;
            for row in &rows[first..] {
                if *row < end {
                    places.push(row - node.start);
                    continue;
                }
                below += node.rows[below..].iter().take_while(|r| *r < row).count();
                places.push(node.width() + below);
            }
            for column in first..last {
                let source = rows[column] - node.start;
                for row in column..rows.len() {
                    let value = node.z[(places[row - first], source)];
                    z[(row, column)] = value;
                    z[(column, row)] = value;
                }
            }
            first = last;
        }
        z
    }

    /// The block for `height` components from `row` on and `width` from `column` on; NaN where the factor has no entry.
    pub fn block(&self, (row, height): (usize, usize), (column, width): (usize, usize)) -> DMatrix<f64> {
        DMatrix::from_fn(height, width, |i, j| {
            let (a, b) = (self.place[row + i], self.place[column + j]);
            let (first, second) = (a.min(b), a.max(b));
            let node = &self.nodes[self.node_of[first] as usize];
            node.row(second).map_or(f64::NAN, |row| node.z[(row, first - node.start)])
        })
    }
}

/// Replaces L_JJ above L_RJ by Z_JJ above Z_RJ, where `below` is Z_RR.
fn invert(z: &mut Mat<f64>, below: MatRef<'_, f64>) {
    let width = z.ncols();
    let (triangle, under) = z.as_ref().split_at_row(width);
    // Yᵀ, from L_JJᵀ Yᵀ = L_RJᵀ.
    let mut y = under.transpose().to_owned();
    solve_upper_triangular_in_place(triangle.transpose(), y.as_mut(), Par::Seq);
    let mut root = Mat::<f64>::identity(width, width);
    solve_lower_triangular_in_place(triangle, root.as_mut(), Par::Seq);
    let mut rows = Mat::zeros(below.nrows(), width);
    matmul(rows.as_mut(), Accum::Replace, below, y.transpose(), -1.0, Par::Seq);
    let mut square = Mat::zeros(width, width);
    matmul(square.as_mut(), Accum::Replace, root.transpose(), root.as_ref(), 1.0, Par::Seq);
    matmul(square.as_mut(), Accum::Add, y.as_ref(), rows.as_ref(), -1.0, Par::Seq);
    let (mut above, mut under) = z.as_mut().split_at_row_mut(width);
    // Symmetric despite rounding errors.
    above.copy_from(Mat::from_fn(width, width, |i, j| 0.5 * (square[(i, j)] + square[(j, i)])));
    under.copy_from(rows);
}
