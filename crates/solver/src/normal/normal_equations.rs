//! The normal equations H δ = −g of a linearised problem, H = Jᵀ W J, g = Jᵀ W r, and their solution.

use nalgebra::DMatrix;
use rayon::prelude::*;

use crate::normal::chunk::Chunk;
use crate::normal::conjugate_gradients::multiply_chunk;
use crate::normal::constrain::constrain_chunk;
use crate::normal::linear::{Linear, Planned};
use crate::normal::qr::multiply_rows;
use crate::normal::reduced_blocks::ReducedBlocks;
use crate::normal::reduced_system::PARALLEL_SIZE;
use crate::plan::bounds::Bounds;
use crate::plan::choice::choose;
use crate::plan::chunk_builder::ChunkBuilder;
use crate::plan::chunk_plan::{ChunkPlan, Form};
use crate::plan::division::{ChunkMembers, divide};
use crate::plan::layout::Layout;
use crate::plan::linear_solver::{LinearSolver, LinearSolverUsed};
use crate::plan::ordering::BlockGraph;
use crate::problem::error::{EvaluationFailure, StructureError};
use crate::problem::graph::Graph;
use crate::problem::key::VariableId;
use crate::problem::labels::{Labels, label};
use crate::problem::values::Values;

/// Smallest useful damping relative to D²: less is below the rounding errors of H, or of JᵀJ implied by a factorisation
/// of J.
const MIN_DAMPING: f64 = 1e-15;
const MIN_DAMPING_ROWS: f64 = 1e-30;

/// A problem's normal equations. Memory is allocated once: linearising and solving do not allocate.
pub(crate) struct NormalEquations {
    pub layout: Layout,
    pub chunks: Vec<Chunk>,
    pub blocks: ReducedBlocks,
    pub(super) linear: Linear,
    /// The block sparsity pattern that the choice of the linear solver analysed.
    graph: Option<BlockGraph>,
    used: LinearSolverUsed,
    /// g and the diagonal of H, in the order of the step: eliminated variables first.
    gradient: Vec<f64>,
    diagonal: Vec<f64>,
    /// Scratch for a tangent vector.
    scratch: Vec<f64>,
    /// Scratch for a step before it is clipped at bounds.
    unclipped: Vec<f64>,
    labels: Labels,
    parallel: bool,
    pub bounds: Bounds,
    /// Whether each component of the step is constrained to zero; empty as long as none can be.
    pub(super) constrained: Vec<bool>,
    /// Whether a solution constrained more components than the active set of the linearisation.
    extended_active_set: bool,
}

impl NormalEquations {
    /// Plans the solution and allocates memory. Unless `parallel`, the calling thread processes all chunks.
    pub fn new(graph: &Graph, values: &Values, wanted: LinearSolver, parallel: bool) -> Result<Self, StructureError> {
        Self::reuse(None, graph, values, wanted, parallel)
    }

    /// Like [`new`](Self::new), but uses orderings and symbolic factorisations of previous normal equations again if they
    /// fit.
    pub fn reuse(
        previous: Option<Self>,
        graph: &Graph,
        values: &Values,
        wanted: LinearSolver,
        parallel: bool,
    ) -> Result<Self, StructureError> {
        let mut layout = Layout::new(graph, values)?;
        let analysed = previous.as_ref().and_then(|p| Some((p.graph.as_ref()?, p.used.estimates.as_slice())));
        let mut choice = choose(graph, values, &layout, wanted, analysed)?;
        layout.partition(&choice.eliminated);
        let form = match choice.solver {
            LinearSolver::ConjugateGradients(_) => Form::Implicit,
            LinearSolver::SparseQr => Form::Rows,
            _ => Form::Explicit,
        };
        let divided = divide(&layout);
        let plan = |members: &ChunkMembers| ChunkBuilder::build(&layout, members, form);
        let plans: Vec<ChunkPlan> =
            if parallel { divided.par_iter().map(plan).collect() } else { divided.iter().map(plan).collect() };
        let chunks: Vec<Chunk> = plans.into_iter().map(Chunk::new).collect();
        let previous = previous.map(|p| (p.linear, p.blocks));
        let Planned { linear, blocks, analyses } = Linear::plan(&mut choice, &layout, &chunks, previous)?;
        let dim = layout.dim();
        let bounds = Bounds::new(graph, values, &layout)?;
        let constrained = vec![false; if bounds.is_empty() { 0 } else { dim }];
        let used = LinearSolverUsed {
            solver: choice.solver,
            forced: wanted != LinearSolver::Auto,
            estimates: choice.estimates,
            eliminated_variables: layout.eliminated.len(),
            eliminated_dim: layout.eliminated_dim,
            reduced_variables: layout.kept.len(),
            reduced_dim: layout.kept_dim,
            iterative: matches!(linear, Linear::Iterative(_)),
            sparse: linear.is_sparse(),
            factor_entries: linear.factor_len(),
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
            unclipped: Vec::new(),
            labels: graph.labels(),
            parallel,
            bounds,
            constrained,
            extended_active_set: false,
        })
    }

    pub fn dim(&self) -> usize {
        self.layout.dim()
    }

    pub fn used(&self) -> &LinearSolverUsed {
        &self.used
    }

    /// Whether the factorisation itself uses the threads of the pool in which it is called.
    pub fn wants_pool(&self) -> bool {
        self.layout.kept_dim >= PARALLEL_SIZE
    }

    /// Smallest damping μ that has an effect beyond rounding errors.
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

    /// Evaluates the cost ½ Σ ρ(‖r‖²).
    pub fn cost(&mut self, values: &Values) -> Result<f64, EvaluationFailure> {
        let batches = &self.layout.batches;
        for_each(&mut self.chunks, self.parallel, |chunk| chunk.evaluate(batches, values));
        total_cost(&mut self.chunks)
    }

    /// Evaluates and accumulates H and g; returns the cost.
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

    /// Constrains the active set, components on a bound across which the cost falls: their gradient becomes zero, their
    /// rows and columns of H those of the identity.
    pub fn constrain_active_set(&mut self, values: &Values) {
        self.extended_active_set = false;
        self.constrained.fill(false);
        let gradient = &self.gradient;
        if self.bounds.mark_outwards(values, |i| -gradient[i], &mut self.constrained) {
            self.constrain();
        }
    }

    /// Applies `constrained` to H and g.
    fn constrain(&mut self) {
        let (eliminated, of_kept) = self.constrained.split_at(self.layout.eliminated_dim);
        for chunk in &mut self.chunks {
            let range = chunk.plan.offset..chunk.plan.offset + chunk.plan.dim;
            constrain_chunk(chunk, &eliminated[range], of_kept);
        }
        self.blocks.constrain(of_kept);
        for (g, _) in self.gradient.iter_mut().zip(&self.constrained).filter(|(_, constrained)| **constrained) {
            *g = 0.0;
        }
    }

    /// Whether [`solve_within`](Self::solve_within) has constrained components beyond the active set since the last
    /// linearisation.
    pub fn extended_active_set(&self) -> bool {
        self.extended_active_set
    }

    /// Like [`solve`](Self::solve), for a step that crosses none of the bounds on which `values` lie: components that
    /// would cross theirs are constrained as well, until none is left. The result is a descent direction.
    #[must_use]
    pub fn solve_within(&mut self, values: &Values, mu: f64, d2: &[f64], step: &mut [f64]) -> bool {
        loop {
            if !self.solve(mu, d2, step) {
                return false;
            }
            if !self.bounds.mark_outwards(values, |i| step[i], &mut self.constrained) {
                return true;
            }
            self.extended_active_set = true;
            self.constrain();
        }
    }

    /// Clips a step that crosses bounds: component by component, or by scaling the whole step if the model predicts no
    /// decrease of the cost otherwise. Returns the predicted decrease of the clipped step, or `None` if no bound is
    /// crossed.
    pub fn clip(&mut self, values: &Values, step: &mut [f64]) -> Option<f64> {
        if self.bounds.is_empty() {
            return None;
        }
        self.unclipped.clear();
        self.unclipped.extend_from_slice(step);
        if !self.bounds.clip(values, step) {
            return None;
        }
        let predicted = self.predict(step);
        if predicted > 0.0 {
            return Some(predicted);
        }
        step.copy_from_slice(&self.unclipped);
        self.bounds.shorten(values, step);
        Some(self.predict(step))
    }

    /// The decrease of the cost for a step that the linear model predicts, −gᵀδ − ½ δᵀHδ.
    fn predict(&self, step: &[f64]) -> f64 {
        let slope: f64 = step.iter().zip(&self.gradient).map(|(s, g)| s * g).sum();
        -slope - 0.5 * self.quadratic_form(step)
    }

    /// xᵀ H x at the last linearisation.
    pub fn quadratic_form(&self, x: &[f64]) -> f64 {
        if matches!(self.linear, Linear::Orthogonal(_)) {
            return multiply_rows(&self.chunks, x).iter().map(|y| y * y).sum();
        }
        let (eliminated, x_kept) = x.split_at(self.layout.eliminated_dim);
        let in_chunk = |chunk: &Chunk| chunk.quadratic_form(&eliminated[chunk.plan.offset..][..chunk.plan.dim], x_kept);
        self.chunks.iter().map(in_chunk).sum::<f64>() + self.blocks.quadratic_form(x_kept)
    }

    /// Writes the solution of (H + μ D²) δ = −g, where `d2` is the diagonal of D²; false if the matrix is not positive
    /// definite.
    #[must_use]
    pub fn solve(&mut self, mu: f64, d2: &[f64], step: &mut [f64]) -> bool {
        if let Linear::Orthogonal(qr) = &mut self.linear {
            return qr.solve(&self.chunks, mu, d2, &self.constrained, step);
        }
        if !self.eliminate(mu, d2) {
            return false;
        }
        let split = self.layout.eliminated_dim;
        let (eliminated, kept_step) = step.split_at_mut(split);
        for (s, g) in kept_step.iter_mut().zip(&self.gradient[split..]) {
            *s = -g;
        }
        for chunk in &self.chunks {
            for local in &chunk.plan.locals {
                let target = &mut kept_step[local.kept as usize..][..local.d as usize];
                target.iter_mut().zip(&chunk.sc[local.local as usize..]).for_each(|(t, s)| *t += s);
            }
        }
        let parallel = self.parallel;
        let solved = match &mut self.linear {
            Linear::Iterative(conjugate) => conjugate.solve(kept_step, &mut self.chunks, &self.blocks, |chunks, x| {
                for_each(chunks, parallel, |chunk| multiply_chunk(chunk, x));
            }),
            Linear::Direct(reduced) => reduced.solve(kept_step),
            Linear::Orthogonal(_) => false,
        };
        if !solved {
            return false;
        }
        let kept_step = &*kept_step;
        for_each(&mut self.chunks, self.parallel, |chunk| chunk.back_substitute(kept_step));
        for chunk in &self.chunks {
            eliminated[chunk.plan.offset..][..chunk.plan.dim].copy_from_slice(&chunk.step);
        }
        step.iter().all(|s| s.is_finite())
    }

    /// Number of conjugate-gradient iterations of the last solution, if they are used.
    #[cfg(test)]
    pub fn conjugate_iterations(&self) -> Option<usize> {
        if let Linear::Iterative(c) = &self.linear { Some(c.iterations) } else { None }
    }

    /// Eliminates, and factorises the reduced system of H + μ D² or its preconditioner.
    pub(super) fn eliminate(&mut self, mu: f64, d2: &[f64]) -> bool {
        for_each(&mut self.chunks, self.parallel, |chunk| chunk.eliminate(mu, d2));
        if self.chunks.iter().any(|c| !c.definite) {
            return false;
        }
        let d2 = &d2[self.layout.eliminated_dim..];
        match &mut self.linear {
            Linear::Iterative(conjugate) => conjugate.prepare(&self.chunks, &self.blocks, mu, d2),
            Linear::Direct(reduced) => {
                reduced.clear();
                self.blocks.assemble(&self.chunks, mu, d2, |index, block, values| reduced.put(index, block, values));
                reduced.factorize()
            }
            Linear::Orthogonal(_) => true,
        }
    }

    /// Constrains these components of the step to zero.
    pub fn constrain_components(&mut self, components: &[usize]) {
        self.constrained.resize(self.layout.dim(), false);
        components.iter().for_each(|i| self.constrained[*i] = true);
        self.constrain();
    }

    /// Subtracts from the diagonal blocks of H of the last linearisation: `part(variable, i, j)` from the entry of the
    /// variable's tangent components i and j. Nothing may be eliminated.
    pub fn subtract_diagonal_blocks(&mut self, part: impl Fn(VariableId, usize, usize) -> f64) {
        let layout = &self.layout;
        self.blocks.subtract_diagonal_blocks(|rank, i, j| {
            let active = &layout.active[layout.kept[rank as usize] as usize];
            let component = |i: usize| active.mask.as_ref().map_or(i, |mask| mask[i] as usize);
            part(active.id, component(i), component(j))
        });
    }

    /// H_cc of the last linearisation as a full matrix, kept_dim × kept_dim.
    pub fn kept_hessian(&self) -> DMatrix<f64> {
        self.blocks.to_dense(self.layout.kept_dim)
    }

    /// Retracts values by a step and projects them onto the bounds.
    pub fn retract(&mut self, values: &mut Values, step: &[f64]) {
        self.layout.retract(values, step, &mut self.scratch);
        self.bounds.project(values);
    }

    /// The label of a variable.
    pub fn label(&self, variable: VariableId) -> String {
        label(&self.labels, variable)
    }
}

/// Calls `f` for every chunk, on several threads if `parallel`.
fn for_each(chunks: &mut [Chunk], parallel: bool, f: impl Fn(&mut Chunk) + Sync + Send) {
    if !parallel || chunks.len() < 2 || rayon::current_num_threads() == 1 {
        chunks.iter_mut().for_each(f);
    } else {
        chunks.par_iter_mut().with_max_len(1).for_each(f);
    }
}

/// Sums the chunks' costs in their order, or returns the first failure.
fn total_cost(chunks: &mut [Chunk]) -> Result<f64, EvaluationFailure> {
    match chunks.iter_mut().find_map(|c| c.failure.take()) {
        Some(failure) => Err(failure),
        None => Ok(chunks.iter().map(|c| c.cost).sum()),
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{SVector, Vector2, Vector3};

    use super::*;
    use crate::plan::linear_solver::Preconditioner;
    use crate::problem::autodiff::Scalar;
    use crate::problem::batch::Batch;
    use crate::problem::factor::{Factor, Over};

    struct Row([f64; 5]);

    impl Factor<1> for Row {
        type Variables = (Vector2<f64>, Vector3<f64>);

        fn residual<T: Scalar>(&self, (p, q): Over<Self::Variables, T>) -> SVector<T, 1> {
            let a = self.0;
            SVector::<T, 1>::new(p[0] * a[0] + p[1] * a[1] + q[0] * a[2] + q[1] * a[3] + q[2] * a[4] - 1.0)
        }
    }

    /// With one kept variable the diagonal block is the whole Schur complement.
    #[test]
    fn a_perfect_preconditioner_needs_one_iteration() {
        let mut values = Values::new();
        let shared = values.insert(Vector2::new(1.0, 2.0));
        let points: Vec<_> = (0..6).map(|_| values.insert(Vector3::zeros())).collect();
        let mut batch = Batch::new("rows");
        for (i, point) in points.iter().enumerate() {
            for j in 0..5 {
                let entry = |k: usize| ((7 * i + 3 * j + 11 * k + i * j * k) as f64).sin();
                batch.push(Row(std::array::from_fn(entry)), (shared, *point));
            }
        }
        let mut graph = Graph::new();
        graph.add_batch(batch);
        graph.eliminate(points);
        let iterations = |preconditioner| {
            let solver = LinearSolver::ConjugateGradients(preconditioner);
            let mut system = NormalEquations::new(&graph, &values, solver, false).unwrap();
            system.linearize(&values).unwrap();
            let n = system.dim();
            assert!(system.solve(1e-3, &vec![1.0; n], &mut vec![0.0; n]));
            system.conjugate_iterations()
        };
        assert_eq!(iterations(Preconditioner::SchurJacobi), Some(1));
        assert_eq!(iterations(Preconditioner::BlockJacobi), Some(2));
    }
}
