//! Iterations do not allocate memory in proportion to the problem.

mod common;

use std::alloc::System;

use common::{Bundle, bundle};
use depthcal_solver::{
    EvaluationError, Graph, Key, LANES, Lane, LaneBatch, Lanes, LinearSolver, Loss, Options, Values, VariableId,
    minimize,
};
use nalgebra::{Vector1, Vector2};
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};

#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

fn allocations(graph: &Graph, values: &Values, linear_solver: LinearSolver, iterations: u64) -> usize {
    let options = Options {
        linear_solver,
        max_iterations: iterations,
        threads: 1,
        gradient_tolerance: 0.0,
        cost_tolerance: 0.0,
        parameter_tolerance: 0.0,
        // Small steps, so that all iterations are accepted and none is the last.
        damping: depthcal_solver::Damping::Nielsen { tau: 1e9 },
        ..Options::default()
    };
    let values = values.clone();
    let region = Region::new(ALLOCATOR);
    let solution = minimize(graph, values, &options).unwrap();
    let count = region.change();
    assert_eq!(solution.report.iterations as u64, iterations, "{}", solution.report);
    count.allocations + count.reallocations
}

/// 20 points of each of many lines y = a x + b with slopes of their own and a common curvature term c x².
struct Lines {
    slopes: Vec<Key<Vector2<f64>>>,
    common: Key<Vector1<f64>>,
    ids: Vec<[VariableId; 2]>,
}

impl LaneBatch<1, 3> for Lines {
    const PATTERN: [&'static [u32]; 1] = [&[0, 1, 2]];
    type Shared = [f64; 3];

    fn name(&self) -> &str {
        "lines"
    }

    fn group_count(&self) -> usize {
        self.slopes.len()
    }

    fn variables(&self, group: usize) -> &[VariableId] {
        &self.ids[group]
    }

    fn residual_count(&self, _: usize) -> usize {
        20
    }

    fn share(&self, group: usize, values: &Values) -> Result<[f64; 3], EvaluationError> {
        let line = values.get(self.slopes[group]);
        Ok([line[0], line[1], values.get(self.common)[0]])
    }

    #[inline(always)]
    fn residuals(&self, group: usize, shared: &[f64; 3], block: usize, residuals: &mut [Lane; 1]) {
        self.linearize(group, shared, block, residuals, &mut [[0.0; LANES]; 3]);
    }

    #[inline(always)]
    fn linearize(
        &self,
        group: usize,
        &[a, b, c]: &[f64; 3],
        block: usize,
        residuals: &mut [Lane; 1],
        jacobian: &mut [Lane; 3],
    ) {
        for l in 0..LANES {
            let x = 0.1 * (block * LANES + l) as f64;
            residuals[0][l] = a * x + b + c * x * x - (1.0 + 0.1 * group as f64) * x.sin();
            jacobian[0][l] = x;
            jacobian[1][l] = 1.0;
            jacobian[2][l] = x * x;
        }
    }
}

fn lines(count: usize) -> (Graph, Values) {
    let mut values = Values::new();
    let common = values.insert(Vector1::new(0.0));
    let slopes: Vec<_> = (0..count).map(|_| values.insert(Vector2::new(5.0, 5.0))).collect();
    let ids = slopes.iter().map(|s| [s.id(), common.id()]).collect();
    let mut graph = Graph::new();
    graph.add_batch(Lanes::new(Lines { slopes, common, ids }));
    (graph, values)
}

// One test in this binary: the counter is one for the process.
#[test]
fn iterations_allocate_a_small_constant() {
    let mut counts = Vec::new();
    for linear_solver in [
        LinearSolver::DenseSchur,
        LinearSolver::SparseSchur,
        LinearSolver::SparseCholesky,
        LinearSolver::ConjugateGradients(depthcal_solver::Preconditioner::SchurJacobi),
    ] {
        for points in [20, 320] {
            let Bundle { graph, values, .. } = bundle(5, points, 0.5, Loss::Huber { delta: 1.0 }, 11);
            // What is laid out once and for the first iterations cancels.
            let short = allocations(&graph, &values, linear_solver, 4);
            let long = allocations(&graph, &values, linear_solver, 12);
            counts.push((long - short) as f64 / 8.0);
        }
    }
    for count in [20, 320] {
        let (graph, values) = lines(count);
        let short = allocations(&graph, &values, LinearSolver::Auto, 4);
        let long = allocations(&graph, &values, LinearSolver::Auto, 12);
        counts.push((long - short) as f64 / 8.0);
    }
    // Per iteration: the copy of the values, one array for each type of variable, and what argmin's state keeps by name.
    for pair in counts.chunks(2) {
        assert!((pair[0] - pair[1]).abs() <= 1.0, "{counts:?}");
        assert!(pair[1] < 40.0, "{counts:?}");
    }
}
