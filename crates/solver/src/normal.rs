//! The normal equations H δ = −g of a linearised problem, H = Jᵀ W J, g = Jᵀ W r, and their solution.

use nalgebra::DMatrix;
use rayon::prelude::*;

use crate::accumulate::Chunk;
use crate::blocks::ReducedBlocks;
use crate::bounds::Bounds;
use crate::chunk::{ChunkBuilder, ChunkPlan, Share};
use crate::conjugate::{Conjugate, multiply_chunk};
use crate::error::{EvaluationFailure, StructureError};
use crate::graph::Graph;
use crate::hold::hold_chunk;
use crate::layout::{Layout, NONE};
use crate::options::{LinearSolver, LinearSolverUsed};
use crate::partition;
use crate::reduced::{PARALLEL_SIZE, Reduced};
use crate::values::Values;

/// Work that a chunk should hold at least, in floating-point operations, and the largest number of chunks.
const CHUNK_WORK: f64 = 5e5;
const MAX_CHUNKS: f64 = 32.0;

/// Size up to which the system over the kept variables is dense without further thought.
const DENSE_SIZE: usize = 400;

/// A problem's normal equations. Memory is laid out once; linearising and solving again do not allocate.
pub(crate) struct NormalEquations {
    pub layout: Layout,
    pub chunks: Vec<Chunk>,
    pub blocks: ReducedBlocks,
    reduced: Reduced,
    used: LinearSolverUsed,
    /// g and the diagonal of H, eliminated variables first.
    gradient: Vec<f64>,
    diagonal: Vec<f64>,
    scratch: Vec<f64>,
    parallel: bool,
    /// Takes the place of `reduced`, if it is there.
    conjugate: Option<Conjugate>,
    pub bounds: Bounds,
    /// Components that are held, if there are bounds.
    held: Vec<bool>,
    /// Whether components are held that the gradient would not lead across their bounds.
    narrowed: bool,
}

impl NormalEquations {
    /// Lays out memory. Where not `parallel`, the chunks are worked through by the calling thread.
    pub fn new(graph: &Graph, values: &Values, choice: LinearSolver, parallel: bool) -> Result<Self, StructureError> {
        let mut layout = Layout::new(graph, values)?;
        match choice {
            LinearSolver::Dense | LinearSolver::SparseCholesky => {}
            _ => layout.partition(&partition::choose(graph, values, &layout)?),
        }
        let shares = shares(&layout);
        let implicit = matches!(choice, LinearSolver::ConjugateGradients(_));
        let plan = |share: &Share| ChunkBuilder::build(&layout, share, implicit);
        let plans: Vec<ChunkPlan> =
            if parallel { shares.par_iter().map(plan).collect() } else { shares.iter().map(plan).collect() };
        let chunks: Vec<Chunk> = plans.into_iter().map(Chunk::new).collect();
        let blocks = ReducedBlocks::new(&layout, &chunks);
        let reduced = reduced_system(&layout, &blocks, choice)?;
        let conjugate = match choice {
            LinearSolver::ConjugateGradients(p) => Some(Conjugate::new(layout.kept_dim, &blocks, &chunks, p)),
            _ => None,
        };
        let n = layout.dim();
        let bounds = Bounds::new(graph, values, &layout)?;
        let held = vec![false; if bounds.is_empty() { 0 } else { n }];
        let used = LinearSolverUsed {
            eliminated_variables: layout.eliminated.len(),
            eliminated_dim: layout.eliminated_dim,
            reduced_variables: layout.kept.len(),
            reduced_dim: layout.kept_dim,
            iterative: conjugate.is_some(),
            sparse: matches!(reduced, Reduced::Sparse(_)),
            factor_entries: reduced.factor_len(),
            chunks: chunks.len(),
        };
        Ok(Self {
            layout,
            chunks,
            blocks,
            reduced,
            used,
            gradient: vec![0.0; n],
            diagonal: vec![0.0; n],
            scratch: Vec::new(),
            parallel,
            conjugate,
            bounds,
            held,
            narrowed: false,
        })
    }

    pub fn dim(&self) -> usize {
        self.layout.dim()
    }

    pub fn used(&self) -> &LinearSolverUsed {
        &self.used
    }

    /// Whether the factorisation itself is split among the threads of the pool it is called in.
    pub fn wants_pool(&self) -> bool {
        self.layout.kept_dim >= PARALLEL_SIZE
    }

    /// g = Jᵀ W r of the last linearisation.
    pub fn gradient(&self) -> &[f64] {
        &self.gradient
    }

    /// The diagonal of H of the last linearisation.
    pub fn diagonal(&self) -> &[f64] {
        &self.diagonal
    }

    /// The cost ½ Σ ρ(‖r‖²).
    pub fn cost(&mut self, values: &Values) -> Result<f64, EvaluationFailure> {
        let batches = &self.layout.batches;
        for_each(&mut self.chunks, self.parallel, |chunk| chunk.evaluate(batches, values));
        total_cost(&mut self.chunks)
    }

    /// Evaluates H and g; returns the cost.
    pub fn linearize(&mut self, values: &Values) -> Result<f64, EvaluationFailure> {
        let batches = &self.layout.batches;
        for_each(&mut self.chunks, self.parallel, |chunk| chunk.linearize(batches, values));
        let cost = total_cost(&mut self.chunks)?;
        self.blocks.gather(&self.chunks);
        let split = self.layout.eliminated_dim;
        self.blocks.diagonal(&mut self.diagonal[split..]);
        self.gradient.fill(0.0);
        for chunk in &self.chunks {
            let range = chunk.plan.offset..chunk.plan.offset + chunk.plan.dim;
            self.gradient[range.clone()].copy_from_slice(&chunk.ge);
            chunk.diagonal(&mut self.diagonal[range]);
            for local in &chunk.plan.locals {
                let target = &mut self.gradient[split + local.kept as usize..][..local.d as usize];
                target.iter_mut().zip(&chunk.gc[local.local as usize..]).for_each(|(t, g)| *t += g);
            }
        }
        Ok(cost)
    }

    /// Holds components at a bound across which the cost falls: their gradient becomes zero, their rows and columns of H
    /// those of the identity.
    pub fn hold_active(&mut self, values: &Values) {
        self.narrowed = false;
        self.held.fill(false);
        let gradient = &self.gradient;
        if self.bounds.mark_outwards(values, |i| -gradient[i], &mut self.held) {
            self.hold();
        }
    }

    fn hold(&mut self) {
        let (eliminated, kept) = self.held.split_at(self.layout.eliminated_dim);
        for chunk in &mut self.chunks {
            let range = chunk.plan.offset..chunk.plan.offset + chunk.plan.dim;
            hold_chunk(chunk, &eliminated[range], kept);
        }
        self.blocks.hold(kept);
        for (g, _) in self.gradient.iter_mut().zip(&self.held).filter(|(_, held)| **held) {
            *g = 0.0;
        }
    }

    /// Whether components are held that the gradient would not lead across their bounds, until the next linearisation.
    pub fn narrowed(&self) -> bool {
        self.narrowed
    }

    /// Like [`solve`](Self::solve), for a step that leads across none of the bounds on which `values` lie: components that
    /// it would lead across theirs are held as well. What remains is a direction in which the cost falls.
    #[must_use]
    pub fn solve_within(&mut self, values: &Values, mu: f64, d2: &[f64], step: &mut [f64]) -> bool {
        loop {
            if !self.solve(mu, d2, step) {
                return false;
            }
            if !self.bounds.mark_outwards(values, |i| step[i], &mut self.held) {
                return true;
            }
            self.narrowed = true;
            self.hold();
        }
    }

    /// Cuts a step that crosses bounds: component by component, or as a whole where the cost would not fall otherwise.
    /// Returns the decrease of the cost that the model then predicts, or nothing if no bound is crossed.
    pub fn clip(&self, values: &Values, step: &mut [f64]) -> Option<f64> {
        if self.bounds.is_empty() {
            return None;
        }
        let whole = step.to_vec();
        if !self.bounds.clip(values, step) {
            return None;
        }
        let predicted = self.predict(step);
        if predicted > 0.0 {
            return Some(predicted);
        }
        step.copy_from_slice(&whole);
        self.bounds.shorten(values, step);
        Some(self.predict(step))
    }

    /// What the model of the last linearisation predicts as decrease of the cost for a step.
    fn predict(&self, step: &[f64]) -> f64 {
        let slope: f64 = step.iter().zip(&self.gradient).map(|(s, g)| s * g).sum();
        -slope - 0.5 * self.quadratic_form(step)
    }

    /// xᵀ H x at the last linearisation.
    pub fn quadratic_form(&self, x: &[f64]) -> f64 {
        let (eliminated, kept) = x.split_at(self.layout.eliminated_dim);
        let own = |chunk: &Chunk| chunk.quadratic_form(&eliminated[chunk.plan.offset..][..chunk.plan.dim], kept);
        self.chunks.iter().map(own).sum::<f64>() + self.blocks.quadratic_form(kept)
    }

    /// Writes the solution of (H + μ D²) δ = −g, where `d2` is the diagonal of D²; false if the matrix is not positive
    /// definite.
    #[must_use]
    pub fn solve(&mut self, mu: f64, d2: &[f64], step: &mut [f64]) -> bool {
        if !self.eliminate(mu, d2) {
            return false;
        }
        let split = self.layout.eliminated_dim;
        let (eliminated, kept) = step.split_at_mut(split);
        for (s, g) in kept.iter_mut().zip(&self.gradient[split..]) {
            *s = -g;
        }
        for chunk in &self.chunks {
            for local in &chunk.plan.locals {
                let target = &mut kept[local.kept as usize..][..local.d as usize];
                target.iter_mut().zip(&chunk.sc[local.local as usize..]).for_each(|(t, s)| *t += s);
            }
        }
        let parallel = self.parallel;
        let solved = match &mut self.conjugate {
            Some(conjugate) => conjugate.solve(kept, &mut self.chunks, &self.blocks, |chunks, x| {
                for_each(chunks, parallel, |chunk| multiply_chunk(chunk, x));
            }),
            None => self.reduced.solve(kept),
        };
        if !solved {
            return false;
        }
        let kept = &*kept;
        for_each(&mut self.chunks, self.parallel, |chunk| chunk.back_substitute(kept));
        for chunk in &self.chunks {
            eliminated[chunk.plan.offset..][..chunk.plan.dim].copy_from_slice(&chunk.step);
        }
        step.iter().all(|s| s.is_finite())
    }

    /// Iterations of conjugate gradients in the last solution, if they are used.
    #[cfg(test)]
    pub fn conjugate_iterations(&self) -> Option<usize> {
        self.conjugate.as_ref().map(|c| c.iterations)
    }

    /// Factorises H + μ D².
    fn eliminate(&mut self, mu: f64, d2: &[f64]) -> bool {
        for_each(&mut self.chunks, self.parallel, |chunk| chunk.eliminate(mu, d2));
        if self.chunks.iter().any(|c| !c.definite) {
            return false;
        }
        if let Some(conjugate) = &mut self.conjugate {
            return conjugate.prepare(&self.chunks, &self.blocks, mu, &d2[self.layout.eliminated_dim..]);
        }
        self.blocks.assemble(&self.chunks, mu, &d2[self.layout.eliminated_dim..], &mut self.reduced);
        self.reduced.factorize()
    }

    /// H_cc of the last linearisation as a full matrix.
    pub fn kept_hessian(&self) -> DMatrix<f64> {
        self.blocks.to_dense(self.layout.kept_dim)
    }

    /// The values moved by a step.
    pub fn retract(&mut self, values: &Values, step: &[f64]) -> Values {
        let mut moved = self.layout.retract(values, step, &mut self.scratch);
        self.bounds.project(&mut moved);
        moved
    }
}

fn for_each(chunks: &mut [Chunk], parallel: bool, f: impl Fn(&mut Chunk) + Sync + Send) {
    if !parallel || chunks.len() < 2 || rayon::current_num_threads() == 1 {
        chunks.iter_mut().for_each(f);
    } else {
        chunks.par_iter_mut().with_max_len(1).for_each(f);
    }
}

fn total_cost(chunks: &mut [Chunk]) -> Result<f64, EvaluationFailure> {
    match chunks.iter_mut().find_map(|c| c.failure.take()) {
        Some(failure) => Err(failure),
        None => Ok(chunks.iter().map(|c| c.cost).sum()),
    }
}

fn reduced_system(layout: &Layout, blocks: &ReducedBlocks, choice: LinearSolver) -> Result<Reduced, StructureError> {
    let n = layout.kept_dim;
    match choice {
        LinearSolver::ConjugateGradients(_) => return Ok(Reduced::dense(0)),
        LinearSolver::Dense | LinearSolver::DenseSchur => return Ok(Reduced::dense(n)),
        LinearSolver::SparseCholesky | LinearSolver::SparseSchur if n > 0 => return Reduced::sparse(n, blocks),
        _ => {}
    }
    let half = 0.5 * n as f64 * n as f64;
    if n <= DENSE_SIZE || blocks.entries() as f64 > 0.3 * half {
        return Ok(Reduced::dense(n));
    }
    let sparse = Reduced::sparse(n, blocks)?;
    // Operations of a sparse factorisation if its columns were of equal length; sparse operations are slower.
    let length = sparse.factor_len() as f64 / n as f64;
    let flops = n as f64 * length * length;
    Ok(if 3.0 * flops < partition::dense_flops(n) { sparse } else { Reduced::dense(n) })
}

/// Divides the groups by estimated work.
fn shares(layout: &Layout) -> Vec<Share> {
    let mut eliminated: Vec<(u32, Vec<u32>)> = layout.eliminated.iter().map(|e| (*e, Vec::new())).collect();
    let mut others = Vec::new();
    let mut work_of = vec![0.0; eliminated.len()];
    let mut total = 0.0;
    let work = |g: usize| {
        let (rows, columns) = (f64::from(layout.groups[g].rows), f64::from(layout.groups[g].columns));
        100.0 + rows * (10.0 + 5.0 * columns + 0.5 * columns * columns)
    };
    for (g, group) in layout.groups.iter().enumerate() {
        total += work(g);
        let e = layout.slots(group).iter().map(|s| &layout.active[s.active as usize]).find(|a| a.eliminated);
        match e.map_or(NONE, |a| a.rank) {
            NONE => others.push(g as u32),
            rank => {
                eliminated[rank as usize].1.push(g as u32);
                work_of[rank as usize] += work(g);
            }
        }
    }
    let target = total / (total / CHUNK_WORK).ceil().clamp(1.0, MAX_CHUNKS);
    let mut shares = vec![Share::default()];
    let mut filled = 0.0;
    let mut next = |shares: &mut Vec<Share>, work: f64| {
        if filled > 0.0 && filled + 0.5 * work > target {
            shares.push(Share::default());
            filled = 0.0;
        }
        filled += work;
        shares.len() - 1
    };
    for (e, work) in eliminated.into_iter().zip(work_of) {
        let share = next(&mut shares, work);
        shares[share].eliminated.push(e);
    }
    for g in others {
        let share = next(&mut shares, work(g as usize));
        shares[share].others.push(g);
    }
    shares
}
