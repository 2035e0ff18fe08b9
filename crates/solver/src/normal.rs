//! The normal equations H δ = −g of a linearised problem, H = Jᵀ W J, g = Jᵀ W r, and their solution.

use faer::{Mat, Side};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::accumulate::Chunk;
use crate::blocks::ReducedBlocks;
use crate::bounds::Bounds;
use crate::choice::choose;
use crate::chunk::{ChunkBuilder, ChunkPlan, Form, Share};
use crate::conjugate::{Conjugate, multiply_chunk};
use crate::error::{EvaluationFailure, StructureError};
use crate::graph::{Graph, Labels, label};
use crate::hold::hold_chunk;
use crate::layout::Layout;
use crate::options::{LinearSolver, LinearSolverUsed};
use crate::ordering::BlockGraph;
use crate::qr::{Qr, multiply_rows};
use crate::reduced::{PARALLEL_SIZE, Reduced};
use crate::shares::shares;
use crate::values::{Values, VariableId};

/// Smallest damping: below, rounding errors of H exceed it; those of a factorisation of J are the squares of that.
const MIN_DAMPING: f64 = 1e-15;
const MIN_DAMPING_ROWS: f64 = 1e-30;

/// How the system over the kept variables is solved.
enum Linear {
    Direct(Reduced),
    Conjugate(Conjugate),
    Orthogonal(Box<Qr>),
}

/// A problem's normal equations. Memory is laid out once; linearising and solving again do not allocate.
pub(crate) struct NormalEquations {
    pub layout: Layout,
    pub chunks: Vec<Chunk>,
    pub blocks: ReducedBlocks,
    linear: Linear,
    /// The graph that the choice of the linear solver looked at.
    graph: Option<BlockGraph>,
    used: LinearSolverUsed,
    /// g and the diagonal of H, eliminated variables first.
    gradient: Vec<f64>,
    diagonal: Vec<f64>,
    scratch: Vec<f64>,
    /// A step before it is cut at bounds.
    whole: Vec<f64>,
    labels: Labels,
    parallel: bool,
    pub bounds: Bounds,
    /// Components that are held, if there are bounds.
    held: Vec<bool>,
    /// Whether components are held that the gradient would not lead across their bounds.
    narrowed: bool,
}

impl NormalEquations {
    /// Lays out memory. Where not `parallel`, the chunks are worked through by the calling thread.
    pub fn new(graph: &Graph, values: &Values, wanted: LinearSolver, parallel: bool) -> Result<Self, StructureError> {
        Self::renew(None, graph, values, wanted, parallel)
    }

    /// Lays out memory, and takes over orderings and symbolic factorisations where they fit.
    pub fn renew(
        previous: Option<Self>,
        graph: &Graph,
        values: &Values,
        wanted: LinearSolver,
        parallel: bool,
    ) -> Result<Self, StructureError> {
        let mut layout = Layout::new(graph, values)?;
        let analysed = previous.as_ref().and_then(|p| Some((p.graph.as_ref()?, p.used.estimates.as_slice())));
        let choice = choose(graph, values, &layout, wanted, analysed)?;
        layout.partition(&choice.eliminated);
        let form = match choice.solver {
            LinearSolver::ConjugateGradients(_) => Form::Implicit,
            LinearSolver::SparseQr => Form::Rows,
            _ => Form::Explicit,
        };
        let shares = shares(&layout);
        let plan = |share: &Share| ChunkBuilder::build(&layout, share, form);
        let plans: Vec<ChunkPlan> =
            if parallel { shares.par_iter().map(plan).collect() } else { shares.iter().map(plan).collect() };
        let chunks: Vec<Chunk> = plans.into_iter().map(Chunk::new).collect();
        let mut blocks = ReducedBlocks::new(&layout, &chunks);
        let n = layout.kept_dim;
        let mut analyses = usize::from(choice.analysed);
        let linear = match (choice.solver, previous.map(|p| (p.linear, p.blocks))) {
            (LinearSolver::ConjugateGradients(p), _) => Linear::Conjugate(Conjugate::new(n, &blocks, &chunks, p)),
            (LinearSolver::SparseQr, previous) if n > 0 => {
                let previous = previous.and_then(|(linear, _)| match linear {
                    Linear::Orthogonal(qr) => Some(*qr),
                    _ => None,
                });
                let (qr, taken_over) = Qr::new(n, &chunks, previous)?;
                analyses = usize::from(!taken_over);
                Linear::Orthogonal(Box::new(qr))
            }
            (LinearSolver::SparseCholesky | LinearSolver::SparseSchur, previous) if n > 0 => {
                let fitted = match previous {
                    Some((Linear::Direct(reduced @ Reduced::Sparse(_)), other)) => {
                        blocks.fitted(&other, &layout, &chunks).map(|fitted| (reduced, fitted))
                    }
                    _ => None,
                };
                Linear::Direct(match fitted {
                    Some((reduced, fitted)) => {
                        blocks = fitted;
                        reduced
                    }
                    None => {
                        analyses = 1;
                        Reduced::sparse(n, &blocks, choice.ordering)?
                    }
                })
            }
            _ => Linear::Direct(Reduced::dense(n)),
        };
        let dim = layout.dim();
        let bounds = Bounds::new(graph, values, &layout)?;
        let held = vec![false; if bounds.is_empty() { 0 } else { dim }];
        let used = LinearSolverUsed {
            solver: choice.solver,
            forced: wanted != LinearSolver::Auto,
            estimates: choice.estimates,
            eliminated_variables: layout.eliminated.len(),
            eliminated_dim: layout.eliminated_dim,
            reduced_variables: layout.kept.len(),
            reduced_dim: n,
            iterative: matches!(linear, Linear::Conjugate(_)),
            sparse: matches!(linear, Linear::Direct(Reduced::Sparse(_)) | Linear::Orthogonal(_)),
            factor_entries: match &linear {
                Linear::Direct(reduced) => reduced.factor_len(),
                Linear::Conjugate(_) => 0,
                Linear::Orthogonal(qr) => qr.factor_len(),
            },
            symbolic_analyses: analyses,
            chunks: chunks.len(),
        };
        Ok(Self {
            layout,
            chunks,
            blocks,
            linear,
            graph: choice.graph,
            used,
            gradient: vec![0.0; dim],
            diagonal: vec![0.0; dim],
            scratch: Vec::new(),
            whole: Vec::new(),
            labels: graph.labels(),
            parallel,
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

    /// Smallest damping μ that rounding errors leave of any use.
    pub fn min_damping(&self) -> f64 {
        if matches!(self.linear, Linear::Orthogonal(_)) { MIN_DAMPING_ROWS } else { MIN_DAMPING }
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
    pub fn clip(&mut self, values: &Values, step: &mut [f64]) -> Option<f64> {
        if self.bounds.is_empty() {
            return None;
        }
        self.whole.clear();
        self.whole.extend_from_slice(step);
        if !self.bounds.clip(values, step) {
            return None;
        }
        let predicted = self.predict(step);
        if predicted > 0.0 {
            return Some(predicted);
        }
        step.copy_from_slice(&self.whole);
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
        if matches!(self.linear, Linear::Orthogonal(_)) {
            return multiply_rows(&self.chunks, x).iter().map(|y| y * y).sum();
        }
        let (eliminated, kept) = x.split_at(self.layout.eliminated_dim);
        let own = |chunk: &Chunk| chunk.quadratic_form(&eliminated[chunk.plan.offset..][..chunk.plan.dim], kept);
        self.chunks.iter().map(own).sum::<f64>() + self.blocks.quadratic_form(kept)
    }

    /// Writes the solution of (H + μ D²) δ = −g, where `d2` is the diagonal of D²; false if the matrix is not positive
    /// definite.
    #[must_use]
    pub fn solve(&mut self, mu: f64, d2: &[f64], step: &mut [f64]) -> bool {
        if let Linear::Orthogonal(qr) = &mut self.linear {
            return qr.solve(&self.chunks, mu, d2, &self.held, step);
        }
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
        let solved = match &mut self.linear {
            Linear::Conjugate(conjugate) => conjugate.solve(kept, &mut self.chunks, &self.blocks, |chunks, x| {
                for_each(chunks, parallel, |chunk| multiply_chunk(chunk, x));
            }),
            Linear::Direct(reduced) => reduced.solve(kept),
            Linear::Orthogonal(_) => false,
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
        if let Linear::Conjugate(c) = &self.linear { Some(c.iterations) } else { None }
    }

    /// Eliminates, and factorises what remains of H + μ D².
    fn eliminate(&mut self, mu: f64, d2: &[f64]) -> bool {
        for_each(&mut self.chunks, self.parallel, |chunk| chunk.eliminate(mu, d2));
        if self.chunks.iter().any(|c| !c.definite) {
            return false;
        }
        let d2 = &d2[self.layout.eliminated_dim..];
        match &mut self.linear {
            Linear::Conjugate(conjugate) => conjugate.prepare(&self.chunks, &self.blocks, mu, d2),
            Linear::Direct(reduced) => {
                self.blocks.assemble(&self.chunks, mu, d2, reduced);
                reduced.factorize()
            }
            Linear::Orthogonal(_) => true,
        }
    }

    /// Factorises H + μ D² for [`solve_many`](Self::solve_many); false if it is not positive definite.
    #[must_use]
    pub fn factorize(&mut self, mu: f64, d2: &[f64]) -> bool {
        self.eliminate(mu, d2)
    }

    /// Solves for right-hand sides side by side with the last factorisation, where nothing is eliminated.
    pub fn solve_many(&mut self, rhs: &mut [f64]) {
        if let Linear::Direct(reduced) = &mut self.linear {
            reduced.solve_many(rhs);
        }
    }

    /// Replaces each of the vectors x, side by side, by (H + μ D²)⁻¹ D² x, where nothing is eliminated and
    /// [`factorize`](Self::factorize) was called with these.
    #[must_use]
    pub fn inverse_iteration(&mut self, mu: f64, d2: &[f64], vectors: &mut [f64]) -> bool {
        if let Linear::Orthogonal(qr) = &mut self.linear {
            return vectors.chunks_exact_mut(d2.len()).all(|x| qr.inverse_iteration(&self.chunks, mu, d2, x));
        }
        for x in vectors.chunks_exact_mut(d2.len()) {
            x.iter_mut().zip(d2).for_each(|(x, d2)| *x *= d2);
        }
        self.solve_many(vectors);
        vectors.iter().all(|x| x.is_finite())
    }

    /// The eigenvalues of Vᵀ H V, ascending, and its eigenvectors, where nothing is eliminated.
    pub fn ritz(&self, vectors: &[DVector<f64>]) -> Option<(Vec<f64>, DMatrix<f64>)> {
        let k = vectors.len();
        if matches!(self.linear, Linear::Orthogonal(_)) {
            // Squares of the singular values of J V, which rounding errors of larger ones do not spoil.
            let products: Vec<Vec<f64>> = vectors.iter().map(|v| multiply_rows(&self.chunks, v.as_slice())).collect();
            let rows = products.first().map_or(0, Vec::len).max(k);
            let image = Mat::from_fn(rows, k, |i, j| products[j].get(i).copied().unwrap_or(0.0));
            let svd = image.thin_svd().ok()?;
            let values = (0..k).rev().map(|i| svd.S()[i] * svd.S()[i]).collect();
            return Some((values, DMatrix::from_fn(k, k, |i, j| svd.V()[(i, k - 1 - j)])));
        }
        let multiply = |v: &DVector<f64>| {
            let mut product = DVector::zeros(v.len());
            self.blocks.multiply(v.as_slice(), product.as_mut_slice());
            product
        };
        let products: Vec<DVector<f64>> = vectors.iter().map(multiply).collect();
        let eigen = Mat::from_fn(k, k, |i, j| vectors[i].dot(&products[j])).self_adjoint_eigen(Side::Lower).ok()?;
        let values = (0..k).map(|i| eigen.S()[i].max(0.0)).collect();
        Some((values, DMatrix::from_fn(k, k, |i, j| eigen.U()[(i, j)])))
    }

    /// Makes rows and columns of components those of the identity.
    pub fn hold_components(&mut self, components: &[usize]) {
        self.held.resize(self.layout.dim(), false);
        components.iter().for_each(|i| self.held[*i] = true);
        self.hold();
    }

    /// The component with the smallest pivot of the last factorisation of H + μ D², relative to D², and that
    /// pivot. Conjugate gradients and QR have no pivots.
    pub fn weakest(&self, d2: &[f64]) -> Option<(usize, f64)> {
        let Linear::Direct(reduced) = &self.linear else { return None };
        let mut weakest: Option<(usize, f64)> = None;
        let mut compare = |i: usize, pivot: f64| {
            let relative = pivot / d2[i];
            let held = self.held.get(i).copied().unwrap_or(false);
            if !held && relative.is_finite() && weakest.is_none_or(|w| relative < w.1) {
                weakest = Some((i, relative));
            }
        };
        for chunk in &self.chunks {
            for e in &chunk.plan.eliminations {
                let d = e.d as usize;
                (0..d).for_each(|i| compare(chunk.plan.offset + e.e + i, chunk.lee[e.ee + i * d + i].powi(2)));
            }
        }
        reduced.for_each_pivot(|i, pivot| compare(self.layout.eliminated_dim + i, pivot));
        weakest
    }

    /// H_cc of the last linearisation as a full matrix.
    pub fn kept_hessian(&self) -> DMatrix<f64> {
        self.blocks.to_dense(self.layout.kept_dim)
    }

    /// Moves values by a step.
    pub fn retract(&mut self, values: &mut Values, step: &[f64]) {
        self.layout.retract(values, step, &mut self.scratch);
        self.bounds.project(values);
    }

    /// The label of a variable.
    pub fn label(&self, variable: VariableId) -> String {
        label(&self.labels, variable)
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
