//! Iterations do not allocate memory beyond what argmin's executor allocates for any solver.

mod common;

use std::alloc::System;

use argmin::core::{Error, Executor, KV, Problem, Solver, State};
use common::{Bundle, bundle};
use depthcal_solver::{
    Batch, Damping, Factor, Graph, LinearSolver, Loss, Method, Options, Over, Preconditioner, Prior, Scalar,
    SolverState, Values, minimize,
};
use nalgebra::{SVector, Vector1, Vector2};
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};

#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

fn allocations(graph: &Graph, values: &Values, linear_solver: LinearSolver, method: Method, iterations: u64) -> usize {
    let options = Options {
        linear_solver,
        method,
        max_iterations: iterations,
        threads: 1,
        gradient_tolerance: 0.0,
        cost_tolerance: 0.0,
        parameter_tolerance: 0.0,
        // Strong damping makes steps small: all are accepted, and none converges.
        damping: Damping::Nielsen { tau: 1e9 },
        ..Options::default()
    };
    let values = values.clone();
    let region = Region::new(ALLOCATOR);
    let solution = minimize(graph, values, &options).unwrap();
    let count = region.change();
    assert_eq!(solution.report.iterations as u64, iterations, "{}", solution.report);
    assert!(solution.report.trace.iter().all(|i| i.accepted), "{}", solution.report);
    count.allocations + count.reallocations
}

/// A point of a curve y = a x + b + c x².
struct Point {
    x: f64,
    y: f64,
}

impl Factor<1> for Point {
    type Variables = (Vector2<f64>, Vector1<f64>);

    fn residual<T: Scalar>(&self, (line, common): Over<Self::Variables, T>) -> SVector<T, 1> {
        SVector::<T, 1>::new(line[0] * self.x + line[1] + common[0] * (self.x * self.x) - self.y)
    }
}

/// Many curves with 20 points each: a and b per curve, c in common.
fn lines(count: usize) -> (Graph, Values) {
    let mut values = Values::new();
    let common = values.insert(Vector1::new(0.0));
    let mut batch = Batch::new("lines");
    for curve in 0..count {
        let line = values.insert(Vector2::new(5.0, 5.0));
        for x in (0..20).map(|i| 0.1 * f64::from(i)) {
            batch.push(Point { x, y: (1.0 + 0.1 * curve as f64) * x.sin() }, (line, common));
        }
    }
    let mut graph = Graph::new();
    graph.add_batch(batch);
    (graph, values)
}

/// A solver without work: it passes the state on and reports two numbers, as ours does.
struct Idle;

impl Solver<Graph, SolverState> for Idle {
    fn name(&self) -> &str {
        "idle"
    }

    fn next_iter(
        &mut self,
        problem: &mut Problem<Graph>,
        mut state: SolverState,
    ) -> Result<(SolverState, Option<KV>), Error> {
        let values = problem.problem("step_count", |_| Ok(state.take_param()))?;
        // The cost falls in every iteration, so that argmin keeps the values as the best.
        let cost = 1.0 / (2.0 + state.get_iter() as f64);
        let state = values.into_iter().fold(state, |state, values| state.param(values)).cost(cost);
        Ok((state, Some(argmin::kv!("gradient" => cost; "damping" => cost;))))
    }
}

fn idle(graph: &Graph, values: &Values, iterations: u64) -> usize {
    let (graph, values) = (graph.clone(), values.clone());
    let region = Region::new(ALLOCATOR);
    let run = Executor::new(graph, Idle)
        .configure(|state: SolverState| state.param(values).max_iters(iterations))
        .ctrlc(false)
        .timer(false)
        .run();
    let count = region.change();
    assert_eq!(run.unwrap().state.get_iter(), iterations);
    count.allocations + count.reallocations
}

/// Allocations of eight more iterations beyond those of the executor. Allocations for set-up and first iterations cancel.
fn own(graph: &Graph, values: &Values, linear_solver: LinearSolver, method: Method) -> isize {
    let per_iteration = |count: &dyn Fn(u64) -> usize| {
        // The minimum of some runs: the first run initialises libraries, and the test harness' own thread allocates
        // occasionally.
        let least = |n| (0..5).map(|_| count(n)).min().unwrap_or(0) as isize;
        least(13) - least(5)
    };
    per_iteration(&|n| allocations(graph, values, linear_solver, method, n))
        - per_iteration(&|n| idle(graph, values, n))
}

// A single test in this binary, because the counter is global to the process.
#[test]
fn iterations_do_not_allocate() {
    let radius = Method::DogLeg { radius: 1e-2 };
    let solvers = [
        (LinearSolver::Dense, Method::LevenbergMarquardt),
        (LinearSolver::DenseSchur, Method::LevenbergMarquardt),
        (LinearSolver::DenseSchur, radius),
        (LinearSolver::SparseSchur, Method::LevenbergMarquardt),
        (LinearSolver::SparseCholesky, Method::LevenbergMarquardt),
        (LinearSolver::ConjugateGradients(Preconditioner::BlockJacobi), Method::LevenbergMarquardt),
        (LinearSolver::ConjugateGradients(Preconditioner::SchurJacobi), Method::LevenbergMarquardt),
        // Not sparse QR: faer allocates within its factorisation.
    ];
    for (linear_solver, method) in solvers {
        for points in [20, 320] {
            if points > 20 && linear_solver == LinearSolver::Dense {
                continue;
            }
            let Bundle { mut graph, values, camera, points, .. } =
                bundle(5, points, 0.5, Loss::Huber { delta: 1.0 }, 11);
            graph.add_batch(Prior::isotropic("camera", camera, *values.get(camera), 10.0).unwrap());
            graph.bound(points[3], 1, -2.0, 2.0);
            assert_eq!(own(&graph, &values, linear_solver, method), 0, "{linear_solver:?} {method:?}");
        }
    }
    for count in [20, 320] {
        let (graph, values) = lines(count);
        assert_eq!(own(&graph, &values, LinearSolver::Auto, Method::LevenbergMarquardt), 0, "{count}");
    }
}
