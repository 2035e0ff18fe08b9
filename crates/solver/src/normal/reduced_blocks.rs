//! The blocks of H_cc, the part of H over the kept variables, summed from the chunks' parts.

use std::ops::Range;

use nalgebra::DMatrix;

use crate::normal::chunk::Chunk;
use crate::normal::constrain::identity_row;
use crate::plan::layout::Layout;

/// A block of the lower triangle of the reduced system.
#[derive(Clone, Debug)]
pub(crate) struct Block {
    /// Ranks among the kept variables, row ≥ column.
    pub row: u32,
    pub column: u32,
    pub row_offset: u32,
    pub column_offset: u32,
    pub row_d: u32,
    pub column_d: u32,
    /// First entry in `values`.
    value: usize,
    /// Entries in `sources` whose sum is the block of H_cc.
    hessian: Range<u32>,
    /// Entries in `sources` whose sum the Schur complement subtracts.
    schur: Range<u32>,
}

/// A chunk's part of a block, at an offset in its `hcc` or `scc`.
#[derive(Clone, Copy, Debug)]
struct Source {
    chunk: u32,
    offset: u32,
}

/// H_cc, and the chunks' parts from which the Schur complement is assembled.
#[derive(Clone, Debug, Default)]
pub(crate) struct ReducedBlocks {
    /// Sorted by column, then row; all diagonal blocks are there.
    pub blocks: Vec<Block>,
    sources: Vec<Source>,
    /// H_cc, block after block, row-major.
    values: Vec<f64>,
    /// One block.
    scratch: Vec<f64>,
}

impl ReducedBlocks {
    pub fn new(layout: &Layout, chunks: &[Chunk]) -> Self {
        Self::with_links(layout, chunks, &[])
    }

    /// These blocks with the block structure of `other`, padded with zero blocks, so that the symbolic factorisation of
    /// `other` can be used again. `None` if `other` lacks a block, has other variables, or has more than twice as many
    /// blocks.
    pub fn with_structure_of(&self, other: &Self, layout: &Layout, chunks: &[Chunk]) -> Option<Self> {
        let key = |b: &Block| (b.column, b.row, b.row_d, b.column_d);
        let mut theirs = other.blocks.iter().map(key);
        let same_variables = self.diagonal_blocks().eq(other.diagonal_blocks());
        if !same_variables || other.blocks.len() > 2 * self.blocks.len() {
            return None;
        }
        if !self.blocks.iter().all(|b| theirs.any(|r| r == key(b))) {
            return None;
        }
        Some(Self::with_links(layout, chunks, &other.links()))
    }

    /// (column, row) of the blocks below the diagonal.
    pub fn links(&self) -> Vec<(u32, u32)> {
        self.blocks.iter().filter(|b| b.row != b.column).map(|b| (b.column, b.row)).collect()
    }

    /// The blocks of all chunks, and blocks for `links` (column, row) even if they are zero.
    fn with_links(layout: &Layout, chunks: &[Chunk], links: &[(u32, u32)]) -> Self {
        const HESSIAN: u8 = 0;
        const SCHUR: u8 = 1;
        const PLACE: u8 = 2;
        let mut parts = Vec::new();
        for (chunk, c) in chunks.iter().enumerate() {
            let chunk = chunk as u32;
            parts.extend(
                c.plan.hcc_blocks.iter().map(|b| (b.column, b.row, HESSIAN, Source { chunk, offset: b.offset })),
            );
            parts
                .extend(c.plan.scc_blocks.iter().map(|b| (b.column, b.row, SCHUR, Source { chunk, offset: b.offset })));
        }
        let diagonal = 0..layout.kept.len() as u32;
        let places = diagonal.map(|rank| (rank, rank)).chain(links.iter().copied());
        parts.extend(places.map(|(column, row)| (column, row, PLACE, Source { chunk: 0, offset: 0 })));
        parts.sort_unstable_by_key(|(column, row, kind, s)| (*column, *row, *kind, s.chunk));
        let mut result = Self::default();
        let mut largest = 0;
        for same in parts.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            let (column, row, ..) = same[0];
            let of_rank = |rank: u32| &layout.active[layout.kept[rank as usize] as usize];
            let (r, c) = (of_rank(row), of_rank(column));
            let start = result.sources.len() as u32;
            let hessian = same.iter().filter(|p| p.2 == HESSIAN).count() as u32;
            let schur = same.iter().filter(|p| p.2 == SCHUR).count() as u32;
            result.sources.extend(same.iter().filter(|p| p.2 != PLACE).map(|p| p.3));
            let size = (r.free * c.free) as usize;
            largest = largest.max(size);
            result.blocks.push(Block {
                row,
                column,
                row_offset: (r.offset - layout.eliminated_dim) as u32,
                column_offset: (c.offset - layout.eliminated_dim) as u32,
                row_d: r.free,
                column_d: c.free,
                value: result.values.len(),
                hessian: start..start + hessian,
                schur: start + hessian..start + hessian + schur,
            });
            // Blocks of the Schur complement alone are zero in H_cc and are not stored.
            let added = if hessian > 0 { size } else { 0 };
            result.values.resize(result.values.len() + added, 0.0);
        }
        result.scratch = vec![0.0; largest];
        result
    }

    /// Sums the chunks' parts of H_cc.
    pub fn gather(&mut self, chunks: &[Chunk]) {
        for block in &self.blocks {
            let size = (block.row_d * block.column_d) as usize;
            for (i, source) in self.sources[block.hessian.start as usize..block.hessian.end as usize].iter().enumerate()
            {
                let part = &chunks[source.chunk as usize].hcc[source.offset as usize..][..size];
                let target = &mut self.values[block.value..][..size];
                if i == 0 {
                    target.copy_from_slice(part);
                } else {
                    target.iter_mut().zip(part).for_each(|(t, p)| *t += p);
                }
            }
        }
    }

    /// Sets the rows and columns of H_cc of constrained components, marked by true, to those of the identity.
    pub fn constrain(&mut self, constrained: &[bool]) {
        for block in self.blocks.iter().filter(|b| !b.hessian.is_empty()) {
            let (dr, dc) = (block.row_d as usize, block.column_d as usize);
            let (row, column) = (block.row_offset as usize, block.column_offset as usize);
            let values = &mut self.values[block.value..][..dr * dc];
            if block.row == block.column {
                (0..dr).filter(|i| constrained[row + i]).for_each(|i| identity_row(values, dr, i));
                continue;
            }
            for (i, values) in values.chunks_exact_mut(dc).enumerate() {
                for (j, value) in values.iter_mut().enumerate() {
                    if constrained[row + i] || constrained[column + j] {
                        *value = 0.0;
                    }
                }
            }
        }
    }

    /// Subtracts from the diagonal blocks of H_cc: `part(rank, i, j)` from the entry of free components i and j of a variable.
    pub fn subtract_diagonal_blocks(&mut self, part: impl Fn(u32, usize, usize) -> f64) {
        for block in self.blocks.iter().filter(|b| b.row == b.column && !b.hessian.is_empty()) {
            let d = block.row_d as usize;
            for (k, value) in self.values[block.value..][..d * d].iter_mut().enumerate() {
                *value -= part(block.row, k / d, k % d);
            }
        }
    }

    /// Writes the diagonal of H_cc.
    pub fn diagonal(&self, target: &mut [f64]) {
        for block in self.blocks.iter().filter(|b| b.row == b.column) {
            let d = block.row_d as usize;
            for i in 0..d {
                let value = if block.hessian.is_empty() { 0.0 } else { self.values[block.value + i * d + i] };
                target[block.row_offset as usize + i] = value;
            }
        }
    }

    /// First component and dimension of every kept variable.
    pub fn diagonal_blocks(&self) -> impl Iterator<Item = (usize, usize)> {
        let diagonal = self.blocks.iter().filter(|b| b.row == b.column);
        diagonal.map(|b| (b.row_offset as usize, b.row_d as usize))
    }

    /// Copies the diagonal blocks of H_cc one after the other, each row-major.
    pub fn copy_diagonal(&self, mut target: &mut [f64]) {
        for block in self.blocks.iter().filter(|b| b.row == b.column) {
            let (head, tail) = target.split_at_mut((block.row_d * block.row_d) as usize);
            if !block.hessian.is_empty() {
                head.copy_from_slice(&self.values[block.value..][..head.len()]);
            }
            target = tail;
        }
    }

    /// y += H_cc x.
    pub fn multiply(&self, x: &[f64], y: &mut [f64]) {
        for block in self.blocks.iter().filter(|b| !b.hessian.is_empty()) {
            let (dr, dc) = (block.row_d as usize, block.column_d as usize);
            let (row, column) = (block.row_offset as usize, block.column_offset as usize);
            for (i, h) in self.values[block.value..][..dr * dc].chunks_exact(dc).enumerate() {
                // Only the lower triangle of a diagonal block is valid.
                let below = if block.row == block.column { i } else { dc };
                for (j, h) in h[..below].iter().enumerate() {
                    y[row + i] += h * x[column + j];
                    y[column + j] += h * x[row + i];
                }
                if block.row == block.column {
                    y[row + i] += h[i] * x[row + i];
                }
            }
        }
    }

    /// xᵀ H_cc x.
    pub fn quadratic_form(&self, x: &[f64]) -> f64 {
        let mut sum = 0.0;
        for block in self.blocks.iter().filter(|b| !b.hessian.is_empty()) {
            let (dr, dc) = (block.row_d as usize, block.column_d as usize);
            let (row, column) = (&x[block.row_offset as usize..][..dr], &x[block.column_offset as usize..][..dc]);
            for (i, h) in self.values[block.value..][..dr * dc].chunks_exact(dc).enumerate() {
                if block.row == block.column {
                    let lower: f64 = h[..i].iter().zip(column).map(|(h, x)| h * x).sum();
                    sum += row[i] * (2.0 * lower + h[i] * row[i]);
                } else {
                    sum += 2.0 * row[i] * h.iter().zip(column).map(|(h, x)| h * x).sum::<f64>();
                }
            }
        }
        sum
    }

    /// H_cc, n × n, both triangles.
    pub fn to_dense(&self, n: usize) -> DMatrix<f64> {
        let mut dense = DMatrix::zeros(n, n);
        for block in self.blocks.iter().filter(|b| !b.hessian.is_empty()) {
            for i in 0..block.row_d as usize {
                let columns = if block.row == block.column { i + 1 } else { block.column_d as usize };
                for j in 0..columns {
                    let (row, column) = (block.row_offset as usize + i, block.column_offset as usize + j);
                    let value = self.values[block.value + i * block.column_d as usize + j];
                    dense[(row, column)] = value;
                    dense[(column, row)] = value;
                }
            }
        }
        dense
    }

    /// Writes the lower triangle of H_cc in another order of its components: component i becomes row and column `rows[i]`.
    pub fn write_dense(&self, rows: &[usize], target: &mut DMatrix<f64>) {
        target.fill(0.0);
        for block in self.blocks.iter().filter(|b| !b.hessian.is_empty()) {
            for i in 0..block.row_d as usize {
                let columns = if block.row == block.column { i + 1 } else { block.column_d as usize };
                for j in 0..columns {
                    let (a, b) = (rows[block.row_offset as usize + i], rows[block.column_offset as usize + j]);
                    target[(a.max(b), a.min(b))] = self.values[block.value + i * block.column_d as usize + j];
                }
            }
        }
    }

    /// Computes the blocks of H_cc + μ D² − Σ H_ce H_ee⁻¹ H_ec and passes each to `put`, with its index and row-major
    /// values.
    pub fn assemble(&mut self, chunks: &[Chunk], mu: f64, d2: &[f64], mut put: impl FnMut(usize, &Block, &[f64])) {
        for (index, block) in self.blocks.iter().enumerate() {
            let size = (block.row_d * block.column_d) as usize;
            let target = &mut self.scratch[..size];
            if block.hessian.is_empty() {
                target.fill(0.0);
            } else {
                target.copy_from_slice(&self.values[block.value..][..size]);
            }
            for source in &self.sources[block.schur.start as usize..block.schur.end as usize] {
                let part = &chunks[source.chunk as usize].scc[source.offset as usize..][..size];
                target.iter_mut().zip(part).for_each(|(t, p)| *t -= p);
            }
            if block.row == block.column {
                let d = block.row_d as usize;
                for i in 0..d {
                    target[i * d + i] += mu * d2[block.row_offset as usize + i];
                }
            }
            put(index, block, target);
        }
    }
}
