//! Least squares by a sparse QR factorisation of the Jacobian.
//!
//! The step minimises ‖J δ + r‖² + μ ‖D δ‖²: the factorised matrix is J with the rows √μ D below. Unlike normal equations
//! this does not square the condition number of J (Golub 1965; Björck 1996, section 2.6), at several times their cost.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::prelude::Reborrow;
use faer::sparse::linalg::qr::{QrSymbolicParams, SymbolicQr, factorize_symbolic_qr};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use faer::{Conj, MatMut, Par};

use crate::normal::chunk::Chunk;
use crate::normal::reduced_system::parallelism;
use crate::plan::ordering::linear_system;
use crate::problem::error::StructureError;

/// The weighted Jacobian of all residuals with the rows of the damping below, in compressed columns.
pub(crate) struct Qr {
    n: usize,
    /// Number of rows of the Jacobian, without those of the damping.
    rows: usize,
    pattern: SymbolicSparseColMat<usize>,
    values: Vec<f64>,
    /// Index in `values` of each entry of the chunks' rows, chunk after chunk.
    places: Vec<usize>,
    symbolic: SymbolicQr<usize>,
    indices: Vec<usize>,
    factors: Vec<f64>,
    rhs: Vec<f64>,
    memory: MemBuffer,
    par: Par,
}

impl Qr {
    /// Allocates memory for n unknowns and chunks of [`Form::Rows`](crate::plan::chunk_plan::Form::Rows) that eliminate
    /// nothing. Uses the symbolic factorisation of `previous` again if the sparsity pattern is the same; the second part
    /// of the result is whether it did.
    pub fn new(n: usize, chunks: &[Chunk], previous: Option<Qr>) -> Result<(Self, bool), StructureError> {
        let mut entries = Vec::new();
        let mut rows = 0;
        for chunk in chunks {
            let mut kept_of = vec![0; chunk.plan.local_dim];
            for local in &chunk.plan.locals {
                (0..local.d as usize).for_each(|k| kept_of[local.local as usize + k] = local.kept as usize + k);
            }
            for group in &chunk.plan.groups {
                let scatter = &chunk.plan.scatters[group.scatter as usize];
                let mut columns = vec![0; scatter.m as usize];
                for v in &scatter.kept {
                    let (first, local) = (v.column as usize, v.local as usize);
                    (0..v.d as usize).for_each(|k| columns[first + k] = kept_of[local + k]);
                }
                for row in rows..rows + group.rows as usize {
                    entries.extend(columns.iter().map(|column| (*column, row)));
                }
                rows += group.rows as usize;
            }
        }
        let mut start = vec![0; n + 1];
        entries.iter().for_each(|(column, _)| start[column + 1] += 1);
        // The damping adds one entry to every column, the last.
        (0..n).for_each(|column| start[column + 1] += start[column] + 1);
        let mut next = start.clone();
        let mut row_of = vec![0; start[n]];
        let mut places = Vec::with_capacity(entries.len());
        for (column, row) in entries {
            places.push(next[column]);
            row_of[next[column]] = row;
            next[column] += 1;
        }
        (0..n).for_each(|column| row_of[next[column]] = rows + column);
        if let Some(previous) = previous
            && (previous.pattern.col_ptr(), previous.pattern.row_idx()) == (start.as_slice(), row_of.as_slice())
        {
            return Ok((Self { places, ..previous }, true));
        }
        let pattern = SymbolicSparseColMat::new_checked(rows + n, n, start, None, row_of);
        let par = parallelism(n);
        let symbolic =
            factorize_symbolic_qr(pattern.rb(), QrSymbolicParams::default()).map_err(|e| linear_system(&e))?;
        let numeric = symbolic.factorize_numeric_qr_scratch::<f64>(par, Default::default());
        let memory = MemBuffer::new(numeric.or(symbolic.solve_in_place_scratch::<f64>(1, par)));
        let qr = Self {
            n,
            rows,
            values: vec![0.0; places.len() + n],
            places,
            indices: vec![0; symbolic.len_idx()],
            factors: vec![0.0; symbolic.len_val()],
            rhs: vec![0.0; rows + n],
            pattern,
            symbolic,
            memory,
            par,
        };
        Ok((qr, false))
    }

    /// Number of entries of the factors.
    pub fn factor_len(&self) -> usize {
        self.factors.len()
    }

    /// Copies the weighted rows from the chunks; columns of constrained components become zero.
    fn gather(&mut self, chunks: &[Chunk], constrained: &[bool]) {
        let mut places = self.places.iter();
        for chunk in chunks {
            for entry in chunk.jacobian_rows().flatten() {
                if let Some(place) = places.next() {
                    self.values[*place] = *entry;
                }
            }
        }
        for column in (0..self.n).filter(|i| constrained.get(*i).copied().unwrap_or(false)) {
            let range = self.pattern.col_range(column);
            self.values[range].fill(0.0);
        }
    }

    /// Sets the rows √μ D.
    fn damp(&mut self, mu: f64, d2: &[f64], constrained: &[bool]) {
        for column in 0..self.n {
            let last = self.pattern.col_range(column).end - 1;
            let is_constrained = constrained.get(column).copied().unwrap_or(false);
            self.values[last] = if is_constrained { 1.0 } else { (mu * d2[column]).sqrt() };
        }
    }

    /// Factorises and solves for the right-hand side in place; false if the solution is not finite.
    fn solve_rhs(&mut self, solution: &mut [f64]) -> bool {
        let matrix = SparseColMatRef::new(self.pattern.rb(), &self.values);
        let stack = MemStack::new(&mut self.memory);
        let Self { indices, factors, .. } = self;
        let qr = self.symbolic.factorize_numeric_qr(indices, factors, matrix, self.par, stack, Default::default());
        let rows = self.rhs.len();
        let x = MatMut::from_column_major_slice_mut(&mut self.rhs, rows, 1);
        qr.solve_in_place_with_conj(Conj::No, x, self.par, stack);
        solution.copy_from_slice(&self.rhs[..self.n]);
        solution.iter().all(|x| x.is_finite())
    }

    /// Writes the step that minimises ‖J δ + r‖² + μ ‖D δ‖², with zeros for constrained components; false if it is not
    /// finite.
    #[must_use]
    pub fn solve(&mut self, chunks: &[Chunk], mu: f64, d2: &[f64], constrained: &[bool], step: &mut [f64]) -> bool {
        self.gather(chunks, constrained);
        self.damp(mu, d2, constrained);
        let residuals = chunks.iter().flat_map(|c| c.residual_rows()).flatten();
        self.rhs.fill(0.0);
        self.rhs.iter_mut().zip(residuals).for_each(|(b, r)| *b = -r);
        self.solve_rhs(step)
    }

    /// An inverse iteration: x ← (JᵀJ + μ D²)⁻¹ D² x; false if it is not finite.
    #[must_use]
    pub fn inverse_iteration(&mut self, chunks: &[Chunk], mu: f64, d2: &[f64], x: &mut [f64]) -> bool {
        self.gather(chunks, &[]);
        self.damp(mu, d2, &[]);
        self.rhs[..self.rows].fill(0.0);
        for (b, (x, d2)) in self.rhs[self.rows..].iter_mut().zip(x.iter().zip(d2)) {
            *b = x * (d2 / mu).sqrt();
        }
        self.solve_rhs(x)
    }
}

/// J x, for chunks of [`Form::Rows`](crate::plan::chunk_plan::Form::Rows).
pub(crate) fn multiply_rows(chunks: &[Chunk], x: &[f64]) -> Vec<f64> {
    let mut product = Vec::new();
    for chunk in chunks {
        for (group, rows) in chunk.plan.groups.iter().zip(chunk.jacobian_rows()) {
            let scatter = &chunk.plan.scatters[group.scatter as usize];
            for row in rows.chunks_exact(scatter.m.max(1) as usize) {
                let mut sum = 0.0;
                for v in &scatter.kept {
                    let (first, d) = (v.column as usize, v.d as usize);
                    let offset = chunk.plan.kept_of_local(v.local);
                    sum += row[first..first + d].iter().zip(&x[offset..offset + d]).map(|(j, x)| j * x).sum::<f64>();
                }
                product.push(sum);
            }
        }
    }
    product
}
