//! Results are bitwise identical for any number of threads.

use crate::common::{Between, Bundle, bundle, normal3, rng};
use depthcal_solver::{
    Batch, Graph, LinearSolver, Loss, Method, Noise, Options, Preconditioner, Prior, Report, Values, minimize,
};
use nalgebra::{Isometry3, Translation3, UnitQuaternion};

/// All numbers of a report except times.
fn numbers(report: &Report) -> Vec<u64> {
    report
        .trace
        .iter()
        .flat_map(|i| [i.cost, i.trial_cost, i.predicted, i.gradient, i.step].map(f64::to_bits))
        .collect()
}

fn solve(graph: &Graph, values: &Values, linear_solver: LinearSolver, threads: usize) -> (Vec<u64>, String) {
    let options = Options { linear_solver, threads, max_iterations: 6, ..Options::default() };
    let solution = minimize(graph, values.clone(), &options).unwrap();
    assert!(solution.report.linear_solver.chunks > 1, "one chunk would prove nothing");
    // The debug form shows every digit of every value.
    (numbers(&solution.report), format!("{:?}", solution.values))
}

fn same_bits(graph: &Graph, values: &Values, linear_solver: LinearSolver) {
    let one = solve(graph, values, linear_solver, 1);
    for threads in [2, 3, 4, 7] {
        assert_eq!(solve(graph, values, linear_solver, threads), one, "{linear_solver:?} {threads}");
    }
}

#[test]
fn every_method_gives_the_same_bits() {
    let Bundle { graph, values, .. } = bundle(12, 400, 0.5, Loss::Huber { delta: 1.5 }, 8);
    for method in [Method::DogLeg { radius: 1e2 }, Method::GaussNewton] {
        let solve = |threads| {
            let options = Options { method, threads, max_iterations: 6, ..Options::default() };
            let solution = minimize(&graph, values.clone(), &options).unwrap();
            (numbers(&solution.report), format!("{:?}", solution.values))
        };
        let one = solve(1);
        assert_eq!(solve(2), one, "{method:?}");
        assert_eq!(solve(5), one, "{method:?}");
    }
}

#[test]
fn a_bundle_gives_the_same_bits() {
    let Bundle { mut graph, values, poses, .. } = bundle(12, 400, 0.5, Loss::Huber { delta: 1.5 }, 6);
    same_bits(&graph, &values, LinearSolver::Auto);
    same_bits(&graph, &values, LinearSolver::SparseSchur);
    same_bits(&graph, &values, LinearSolver::ConjugateGradients(Preconditioner::BlockJacobi));
    same_bits(&graph, &values, LinearSolver::ConjugateGradients(Preconditioner::SchurJacobi));
    // With cameras eliminated 1200 unknowns remain: the dense factorisation runs in parallel.
    graph.eliminate(poses);
    same_bits(&graph, &values, LinearSolver::DenseSchur);
}

/// A helix of poses with loops.
fn pose_graph(count: usize) -> (Graph, Values) {
    let mut rng = rng(7);
    let mut values = Values::new();
    let mut graph = Graph::new();
    let truth: Vec<_> = (0..count)
        .map(|i| {
            let angle = 0.2 * i as f64;
            let t = Translation3::new(5.0 * angle.cos(), 5.0 * angle.sin(), 0.05 * i as f64);
            Isometry3::from_parts(t, UnitQuaternion::from_euler_angles(0.0, 0.0, angle))
        })
        .collect();
    let keys: Vec<_> = truth
        .iter()
        .map(|p| {
            let r = p.rotation * UnitQuaternion::from_scaled_axis(0.02 * normal3(&mut rng));
            values.insert(Isometry3::from_parts(Translation3::from(p.translation.vector + 0.1 * normal3(&mut rng)), r))
        })
        .collect();
    let mut batch = Batch::new("between").with_noise(Noise::diagonal([0.01, 0.01, 0.01, 0.05, 0.05, 0.05]).unwrap());
    for i in 0..count {
        for step in [1, 31, 32] {
            if i + step < count {
                let noise = Isometry3::from_parts(
                    Translation3::from(0.05 * normal3(&mut rng)),
                    UnitQuaternion::from_scaled_axis(0.01 * normal3(&mut rng)),
                );
                batch.push(Between(truth[i].inverse() * truth[i + step] * noise), (keys[i], keys[i + step]));
            }
        }
    }
    graph.add_batch(batch);
    graph.add_batch(Prior::isotropic("first pose", keys[0], truth[0], 1e-3).unwrap());
    (graph, values)
}

#[test]
fn a_pose_graph_gives_the_same_bits() {
    let (graph, values) = pose_graph(800);
    let chosen = minimize(&graph, values.clone(), &Options::default()).unwrap().report;
    assert!(chosen.converged, "{chosen}");
    assert!(chosen.linear_solver.sparse, "{}", chosen.linear_solver);
    assert_eq!(chosen.linear_solver.eliminated_variables, 0);
    same_bits(&graph, &values, LinearSolver::Auto);
    let (graph, values) = pose_graph(200);
    same_bits(&graph, &values, LinearSolver::Dense);
    same_bits(&graph, &values, LinearSolver::SparseQr);
}
