//! The reduced system, over the kept variables: its factorisation as a dense or as a sparse matrix.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt;
use faer::prelude::Reborrow;
use faer::sparse::linalg::cholesky::supernodal::SupernodalLltRef;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use faer::{Conj, MatMut, MatRef, Par, Side};

use crate::normal::reduced_blocks::{Block, ReducedBlocks};
use crate::plan::ordering::{BlockGraph, Ordering, linear_system, permutation};
use crate::problem::error::StructureError;

/// Number of unknowns from which a factorisation is worth several threads.
pub(crate) const PARALLEL_SIZE: usize = 256;

/// A symmetric positive definite system that is filled and factorised anew in every iteration.
pub(crate) enum ReducedSystem {
    Dense(Dense),
    Sparse(Box<Sparse>),
}

/// Column-major n × n, lower triangle, factorised in place.
pub(crate) struct Dense {
    n: usize,
    matrix: Vec<f64>,
    memory: MemBuffer,
    par: Par,
}

/// The lower triangle in compressed columns, with its symbolic factorisation.
pub(crate) struct Sparse {
    n: usize,
    pattern: SymbolicSparseColMat<usize>,
    values: Vec<f64>,
    /// For each block the number of rows of its block column between the diagonal block and the block.
    row_offset: Vec<usize>,
    symbolic: SymbolicCholesky<usize>,
    factor: Vec<f64>,
    memory: MemBuffer,
    par: Par,
}

/// The parallelism of a factorisation: a fixed number of parts, so that results do not depend on the number of threads.
pub(crate) fn parallelism(n: usize) -> Par {
    if n < PARALLEL_SIZE { Par::Seq } else { Par::rayon(8) }
}

impl ReducedSystem {
    /// A dense system of n unknowns.
    pub fn dense(n: usize) -> Self {
        let par = parallelism(n);
        let factor = llt::factor::cholesky_in_place_scratch::<f64>(n, par, Default::default());
        let memory = MemBuffer::new(factor.or(llt::solve::solve_in_place_scratch::<f64>(n, 1, par)));
        ReducedSystem::Dense(Dense { n, matrix: vec![0.0; n * n], memory, par })
    }

    /// A sparse system of n unknowns; the variables are ordered here unless an `ordering` is given.
    pub fn sparse(n: usize, blocks: &ReducedBlocks, ordering: Option<Ordering>) -> Result<Self, StructureError> {
        let diagonal: Vec<(usize, usize)> = blocks.diagonal_blocks().collect();
        let first: Vec<usize> = diagonal.iter().map(|b| b.0).collect();
        let dims: Vec<u32> = diagonal.iter().map(|b| b.1 as u32).collect();
        let ordering = match ordering {
            Some(ordering) => ordering,
            None => BlockGraph::new(dims.clone(), blocks.links()).analyse()?,
        };
        let permutation = permutation(&ordering.order, &first, &dims);
        let (pattern, row_offset) = sparse_pattern(n, blocks);
        let par = parallelism(n);
        let symbolic = factorize_symbolic_cholesky(
            pattern.rb(),
            Side::Lower,
            SymmetricOrdering::Custom(permutation.as_ref()),
            CholeskySymbolicParams::default(),
        )
        .map_err(|e| linear_system(&e))?;
        let numeric = symbolic.factorize_numeric_llt_scratch::<f64>(par, Default::default());
        let memory = MemBuffer::new(numeric.or(symbolic.solve_in_place_scratch::<f64>(1, par)));
        let values = vec![0.0; pattern.compute_nnz()];
        let factor = vec![0.0; symbolic.len_val()];
        Ok(ReducedSystem::Sparse(Box::new(Sparse { n, pattern, values, row_offset, symbolic, factor, memory, par })))
    }

    /// Calls `f` with every component and its pivot in the last factorisation, the square of the triangular factor's
    /// diagonal element.
    pub fn for_each_pivot(&self, mut f: impl FnMut(usize, f64)) {
        match self {
            ReducedSystem::Dense(d) => (0..d.n).for_each(|i| f(i, d.matrix[i * d.n + i].powi(2))),
            ReducedSystem::Sparse(s) => {
                let forward = s.symbolic.perm().map(|p| p.arrays().0);
                let mut pivot = |i: usize, l: f64| f(forward.map_or(i, |p| p[i]), l * l);
                match s.symbolic.raw() {
                    SymbolicCholeskyRaw::Simplicial(raw) => {
                        (0..s.n).for_each(|j| pivot(j, s.factor[raw.col_ptr()[j]]));
                    }
                    SymbolicCholeskyRaw::Supernodal(raw) => {
                        let factor = SupernodalLltRef::new(raw, &s.factor);
                        for index in 0..raw.n_supernodes() {
                            let node = factor.supernode(index);
                            (0..node.val().ncols()).for_each(|j| pivot(node.start() + j, node.val()[(j, j)]));
                        }
                    }
                }
            }
        }
    }

    /// Number of entries of the triangular factor.
    pub fn factor_len(&self) -> usize {
        match self {
            ReducedSystem::Dense(d) => d.n * (d.n + 1) / 2,
            ReducedSystem::Sparse(s) => s.symbolic.len_val(),
        }
    }

    /// Prepares for new values: blocks that are not written by [`put`](Self::put) are zero.
    pub fn clear(&mut self) {
        if let ReducedSystem::Dense(dense) = self {
            // Factorisation fills entries outside the blocks.
            dense.matrix.fill(0.0);
        }
    }

    /// Writes the block with this index. `values` is row-major; of a diagonal block only the lower triangle is read.
    pub fn put(&mut self, index: usize, block: &Block, values: &[f64]) {
        let (dr, dc) = (block.row_d as usize, block.column_d as usize);
        let (row, column) = (block.row_offset as usize, block.column_offset as usize);
        match self {
            ReducedSystem::Dense(dense) => {
                for c in 0..dc {
                    let first = if row == column { c } else { 0 };
                    let target = &mut dense.matrix[(column + c) * dense.n + row..][first..dr];
                    for (a, t) in (first..dr).zip(target) {
                        *t = values[a * dc + c];
                    }
                }
            }
            ReducedSystem::Sparse(sparse) => {
                let start = sparse.pattern.col_ptr();
                for c in 0..dc {
                    // A column has the lower part of its diagonal block, then the blocks below in order.
                    let (first, before) = if row == column { (c, 0) } else { (0, dc - c + sparse.row_offset[index]) };
                    let target = &mut sparse.values[start[column + c] + before..][..dr - first];
                    for (a, t) in (first..dr).zip(target) {
                        *t = values[a * dc + c];
                    }
                }
            }
        }
    }

    /// Factorises; false if the matrix is not positive definite.
    #[must_use]
    pub fn factorize(&mut self) -> bool {
        let regularization =
            llt::factor::LltRegularization { dynamic_regularization_delta: 0.0, dynamic_regularization_epsilon: 0.0 };
        match self {
            ReducedSystem::Dense(d) => {
                let matrix = MatMut::from_column_major_slice_mut(&mut d.matrix, d.n, d.n);
                let stack = MemStack::new(&mut d.memory);
                llt::factor::cholesky_in_place(matrix, regularization, d.par, stack, Default::default()).is_ok()
            }
            ReducedSystem::Sparse(s) => {
                let matrix = SparseColMatRef::new(s.pattern.rb(), &s.values);
                let stack = MemStack::new(&mut s.memory);
                let result = s.symbolic.factorize_numeric_llt(
                    &mut s.factor,
                    matrix,
                    Side::Lower,
                    regularization,
                    s.par,
                    stack,
                    Default::default(),
                );
                result.is_ok()
            }
        }
    }

    /// Solves in place for several right-hand sides of n components each, one after the other in memory.
    pub fn solve_many(&mut self, rhs: &mut [f64]) {
        match self {
            ReducedSystem::Dense(d) if d.n > 0 => rhs.chunks_exact_mut(d.n).for_each(|column| {
                let factor = MatRef::from_column_major_slice(&d.matrix, d.n, d.n);
                let x = MatMut::from_column_major_slice_mut(column, d.n, 1);
                llt::solve::solve_in_place(factor, x, d.par, MemStack::new(&mut d.memory));
            }),
            ReducedSystem::Sparse(s) if s.n > 0 => {
                let columns = rhs.len() / s.n;
                let mut memory = MemBuffer::new(s.symbolic.solve_in_place_scratch::<f64>(columns, s.par));
                let x = MatMut::from_column_major_slice_mut(rhs, s.n, columns);
                let factor = LltRef::new(&s.symbolic, &s.factor);
                factor.solve_in_place_with_conj(Conj::No, x, s.par, MemStack::new(&mut memory));
            }
            _ => {}
        }
    }

    /// Solves in place with the last factorisation; false if the solution is not finite.
    #[must_use]
    pub fn solve(&mut self, rhs: &mut [f64]) -> bool {
        match self {
            ReducedSystem::Dense(d) => {
                let factor = MatRef::from_column_major_slice(&d.matrix, d.n, d.n);
                let x = MatMut::from_column_major_slice_mut(rhs, d.n, 1);
                llt::solve::solve_in_place(factor, x, d.par, MemStack::new(&mut d.memory));
            }
            ReducedSystem::Sparse(s) => {
                let x = MatMut::from_column_major_slice_mut(rhs, s.n, 1);
                LltRef::new(&s.symbolic, &s.factor).solve_in_place_with_conj(
                    Conj::No,
                    x,
                    s.par,
                    MemStack::new(&mut s.memory),
                );
            }
        }
        rhs.iter().all(|x| x.is_finite())
    }
}

impl Sparse {
    /// Calls `f` with every supernode of the factor in the order of elimination: its first column, the rows below its columns,
    /// ascending, and its columns, with the lower triangle of the diagonal block above the rows. Above the diagonal numbers are
    /// undefined.
    pub fn for_each_node(&self, mut f: impl FnMut(usize, &[usize], MatRef<'_, f64>)) {
        match self.symbolic.raw() {
            SymbolicCholeskyRaw::Simplicial(raw) => {
                for j in 0..self.n {
                    let range = raw.col_ptr()[j]..raw.col_ptr()[j + 1];
                    let entries = raw.row_idx()[range.clone()].iter().copied().zip(self.factor[range].iter().copied());
                    let mut entries: Vec<(usize, f64)> = entries.collect();
                    entries.sort_unstable_by_key(|entry| entry.0);
                    let rows: Vec<usize> = entries[1..].iter().map(|entry| entry.0).collect();
                    let values: Vec<f64> = entries.iter().map(|entry| entry.1).collect();
                    f(j, &rows, MatRef::from_column_major_slice(&values, values.len(), 1));
                }
            }
            SymbolicCholeskyRaw::Supernodal(raw) => {
                let factor = SupernodalLltRef::new(raw, &self.factor);
                for index in 0..raw.n_supernodes() {
                    let node = factor.supernode(index);
                    f(node.start(), node.pattern(), node.val());
                }
            }
        }
    }

    /// The place of each component in the order of elimination.
    pub fn places(&self) -> Vec<usize> {
        self.symbolic.perm().map_or_else(|| (0..self.n).collect(), |p| p.arrays().1.to_vec())
    }
}

/// The scalar sparsity pattern of the blocks' lower triangle, and [`Sparse::row_offset`].
fn sparse_pattern(n: usize, blocks: &ReducedBlocks) -> (SymbolicSparseColMat<usize>, Vec<usize>) {
    let mut row_offset = vec![0; blocks.blocks.len()];
    let mut start = Vec::with_capacity(n + 1);
    let mut rows = Vec::new();
    start.push(0);
    // Blocks are sorted by column, then row, so that a column's diagonal block comes first.
    let mut first = 0;
    while first < blocks.blocks.len() {
        let column = blocks.blocks[first].column;
        let end = first + blocks.blocks[first..].iter().take_while(|b| b.column == column).count();
        let mut below = 0;
        for i in first + 1..end {
            row_offset[i] = below;
            below += blocks.blocks[i].row_d as usize;
        }
        let diagonal = &blocks.blocks[first];
        for c in 0..diagonal.column_d as usize {
            let offset = diagonal.column_offset as usize;
            rows.extend(offset + c..offset + diagonal.column_d as usize);
            for b in &blocks.blocks[first + 1..end] {
                rows.extend(b.row_offset as usize..(b.row_offset + b.row_d) as usize);
            }
            start.push(rows.len());
        }
        first = end;
    }
    (SymbolicSparseColMat::new_checked(n, n, start, None, rows), row_offset)
}
