//! Iterations do not allocate memory in proportion to the problem.

mod common;

use std::alloc::System;

use common::{Bundle, bundle};
use depthcal_solver::{Graph, LinearSolver, Loss, Options, Values, minimize};
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
        // Small steps, so that all iterations are accepted.
        damping: depthcal_solver::Damping::Nielsen { tau: 1e4 },
        ..Options::default()
    };
    let values = values.clone();
    let region = Region::new(ALLOCATOR);
    let solution = minimize(graph, values, &options).unwrap();
    let count = region.change();
    assert_eq!(solution.report.iterations as u64, iterations, "{}", solution.report);
    count.allocations + count.reallocations
}

// One test in this binary: the counter is one for the process.
#[test]
fn iterations_allocate_a_small_constant() {
    let mut counts = Vec::new();
    for linear_solver in [LinearSolver::DenseSchur, LinearSolver::SparseSchur, LinearSolver::SparseCholesky] {
        for points in [20, 320] {
            let Bundle { graph, values, .. } = bundle(5, points, 0.5, Loss::Huber { delta: 1.0 }, 11);
            // What is laid out once and for the first iterations cancels.
            let short = allocations(&graph, &values, linear_solver, 4);
            let long = allocations(&graph, &values, linear_solver, 12);
            counts.push((long - short) as f64 / 8.0);
        }
    }
    // Per iteration: the copy of the values, one array for each type of variable, and what argmin's state keeps by name.
    for pair in counts.chunks(2) {
        assert!((pair[0] - pair[1]).abs() <= 1.0, "{counts:?}");
        assert!(pair[1] < 40.0, "{counts:?}");
    }
}
