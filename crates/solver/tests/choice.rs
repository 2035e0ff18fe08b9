//! The linear solver is chosen by estimated work, and the choice is reported.

use crate::common::{Bundle, Distance, bundle, normal3, rng};
use depthcal_solver::{
    Batch, Factor, Graph, LinearSolver, LinearSolverUsed, Loss, Options, Over, Preconditioner, Prior, Scalar, Values,
    minimize,
};
use nalgebra::{SVector, Vector3};
use rand::seq::index::sample;

fn used(graph: &Graph, values: &Values, linear_solver: LinearSolver) -> LinearSolverUsed {
    let options = Options { linear_solver, max_iterations: 1, ..Options::default() };
    minimize(graph, values.clone(), &options).unwrap().report.linear_solver
}

fn cost(used: &LinearSolverUsed, solver: LinearSolver) -> f64 {
    used.estimates.iter().find(|e| e.solver == solver).map_or(f64::NAN, |e| e.cost)
}

/// Points in a row or on a grid of dimension `D`, with distances between neighbours.
fn lattice<const D: u32>(side: usize) -> (Graph, Values) {
    let mut rng = rng(1);
    let mut values = Values::new();
    let count = side.pow(D);
    let keys: Vec<_> = (0..count)
        .map(|i| {
            let coordinate = |d: u32| (i / side.pow(d) % side) as f64;
            values.insert(
                Vector3::new(coordinate(0), coordinate(1), if D > 2 { coordinate(2) } else { 0.0 })
                    + 0.1 * normal3(&mut rng),
            )
        })
        .collect();
    let mut distances = Batch::new("distances");
    for i in 0..count {
        for d in 0..D {
            if i / side.pow(d) % side + 1 < side {
                distances.push(Distance(1.0), (keys[i], keys[i + side.pow(d)]));
            }
        }
    }
    let mut graph = Graph::new();
    graph.add_batch(distances);
    for key in keys {
        graph.add_batch(Prior::isotropic("near", key, *values.get(key), 1.0).unwrap());
    }
    (graph, values)
}

#[test]
fn small_problems_are_dense_and_chains_are_sparse() {
    let (graph, values) = lattice::<1>(10);
    assert_eq!(used(&graph, &values, LinearSolver::Auto).solver, LinearSolver::Dense);
    let (graph, values) = lattice::<1>(600);
    let chain = used(&graph, &values, LinearSolver::Auto);
    assert_eq!(chain.solver, LinearSolver::SparseCholesky);
    assert!(!chain.forced);
    // A chain of n blocks of three takes n (9 + 27 + 27) operations or fewer; sparse operations count three times.
    assert!(cost(&chain, LinearSolver::SparseCholesky) <= 3.0 * 600.0 * 63.0, "{chain:?}");
    assert!((cost(&chain, LinearSolver::Dense) / (1800.0_f64.powi(3) / 3.0) - 1.0).abs() < 1e-12);
    assert!(chain.factor_entries < 600 * 30, "{chain:?}");
}

#[test]
fn bundles_are_reduced_to_their_cameras() {
    let Bundle { graph, values, points, .. } = bundle(6, 100, 0.5, Loss::Trivial, 1);
    let chosen = used(&graph, &values, LinearSolver::Auto);
    assert_eq!((chosen.solver, chosen.eliminated_variables), (LinearSolver::DenseSchur, points.len()));
    assert!(cost(&chosen, LinearSolver::DenseSchur) < cost(&chosen, LinearSolver::Dense));
    let forced = used(&graph, &values, LinearSolver::SparseSchur);
    assert!(forced.forced && forced.sparse && forced.estimates.is_empty());
}

/// A landmark seen from a position.
struct Sight(Vector3<f64>);

impl Factor<3> for Sight {
    type Variables = (Vector3<f64>, SVector<f64, 4>);

    fn residual<T: Scalar>(&self, (position, landmark): Over<Self::Variables, T>) -> SVector<T, 3> {
        SVector::<T, 3>::from_fn(|i, _| landmark[i] - position[i] + landmark[3] * 0.01 - self.0[i])
    }
}

/// Positions in a row, each of which sees the landmarks up to `range` places away.
fn survey(positions: usize, range: usize) -> (Graph, Values) {
    let mut rng = rng(2);
    let mut values = Values::new();
    let from: Vec<_> = (0..positions).map(|i| values.insert(Vector3::new(i as f64, 0.0, 0.0))).collect();
    let to: Vec<_> = (0..2 * positions).map(|_| values.insert(SVector::<f64, 4>::zeros())).collect();
    let mut graph = Graph::new();
    let mut sights = Batch::new("sights");
    for (j, landmark) in to.iter().enumerate() {
        for position in &from[(j / 2).saturating_sub(range)..(j / 2 + range).min(positions)] {
            sights.push(Sight(normal3(&mut rng)), (*position, *landmark));
        }
        graph.add_batch(Prior::isotropic("landmark", *landmark, SVector::zeros(), 10.0).unwrap());
    }
    graph.add_batch(sights);
    (graph, values)
}

#[test]
fn what_elimination_leaves_is_sparse_or_left_as_it_is() {
    // Neighbours see the same landmarks: the Schur complement is banded.
    let (graph, values) = survey(400, 4);
    let band = used(&graph, &values, LinearSolver::Auto);
    assert_eq!(band.solver, LinearSolver::SparseSchur, "{band:?}");
    assert!(band.sparse && band.symbolic_analyses == 1);
    // Every position sees nearly all landmarks: the Schur complement is full, and forming it costs more than products with it.
    let (graph, values) = survey(700, 60);
    let wide = used(&graph, &values, LinearSolver::Auto);
    let iterative = LinearSolver::ConjugateGradients(Preconditioner::SchurJacobi);
    assert_eq!(wide.estimates.len(), 4, "{wide:?}");
    let least = wide.estimates.iter().map(|e| e.cost).fold(f64::INFINITY, f64::min);
    assert_eq!(cost(&wide, wide.solver), least);
    assert!(cost(&wide, iterative) < cost(&wide, LinearSolver::Dense));
    // All give the same step.
    let step = |linear_solver| {
        let options = Options { linear_solver, max_iterations: 1, ..Options::default() };
        minimize(&graph, values.clone(), &options).unwrap().report.cost
    };
    let expected = step(LinearSolver::DenseSchur);
    for linear_solver in [iterative, LinearSolver::SparseSchur, LinearSolver::Auto] {
        assert!((step(linear_solver) - expected).abs() < 1e-9 * expected);
    }
}

#[test]
fn large_reduced_systems_that_fill_up_are_solved_iteratively() {
    // Each landmark is seen from four random positions.
    let mut rng = rng(4);
    let mut values = Values::new();
    let from: Vec<_> = (0..1000).map(|i| values.insert(Vector3::new(i as f64, 0.0, 0.0))).collect();
    let mut graph = Graph::new();
    let mut sights = Batch::new("sights");
    for _ in 0..2000 {
        let landmark = values.insert(SVector::<f64, 4>::zeros());
        for position in sample(&mut rng, from.len(), 4) {
            sights.push(Sight(normal3(&mut rng)), (from[position], landmark));
        }
        graph.add_batch(Prior::isotropic("landmark", landmark, SVector::zeros(), 10.0).unwrap());
    }
    graph.add_batch(sights);
    let chosen = minimize(&graph, values.clone(), &Options::default()).unwrap();
    let solver = &chosen.report.linear_solver;
    assert!(matches!(solver.solver, LinearSolver::ConjugateGradients(_)) && solver.iterative, "{solver:?}");
    assert!(cost(solver, LinearSolver::SparseSchur) > cost(solver, solver.solver));
    assert!(chosen.report.converged, "{}", chosen.report);
    // The problem is linear: the decomposition gives the minimum.
    let expected =
        minimize(&graph, values, &Options { linear_solver: LinearSolver::DenseSchur, ..Options::default() }).unwrap();
    assert!((chosen.report.cost - expected.report.cost).abs() < 1e-8 * expected.report.cost);
}

#[test]
fn the_report_shows_the_choice() {
    let (graph, values) = lattice::<2>(20);
    let report = minimize(&graph, values, &Options::default()).unwrap().report;
    let text = report.to_string();
    assert!(text.contains("estimated operations: dense Cholesky") && text.contains("sparse Cholesky"), "{text}");
}
