//! Sessions: after a change of the problem the result is that of a new solver, and symbolic factorisations are used again
//! while they fit.

use crate::common::{self, Between, normal3, rng};
use depthcal_solver::{
    Batch, Graph, Key, LinearSolver, Noise, Options, Prior, Session, Solution, Values, VariableId, minimize,
};
use nalgebra::{Isometry3, Translation3, UnitQuaternion};

struct Poses {
    graph: Graph,
    values: Values,
    truth: Vec<Isometry3<f64>>,
    keys: Vec<Key<Isometry3<f64>>>,
    rng: rand_chacha::ChaCha8Rng,
}

const NOISE: [f64; 6] = [0.01, 0.01, 0.01, 0.05, 0.05, 0.05];

impl Poses {
    /// Poses on a square grid, each linked to its neighbours.
    fn grid(side: usize) -> Self {
        let mut poses =
            Self { graph: Graph::new(), values: Values::new(), truth: Vec::new(), keys: Vec::new(), rng: rng(3) };
        for i in 0..side * side {
            let (row, column) = (i / side, i % side);
            let rotation = UnitQuaternion::from_euler_angles(0.1 * row as f64, 0.05 * column as f64, 0.02 * i as f64);
            poses.add(Isometry3::from_parts(Translation3::new(row as f64, column as f64, 0.0), rotation));
        }
        let mut links = Vec::new();
        for i in 0..side * side {
            links.extend((i % side + 1 < side).then_some((i, i + 1)));
            links.extend((i + side < side * side).then_some((i, i + side)));
        }
        poses.link("grid", &links);
        poses.graph.add_batch(Prior::isotropic("first", poses.keys[0], poses.truth[0], 1e-2).unwrap());
        poses
    }

    fn add(&mut self, truth: Isometry3<f64>) {
        let r = truth.rotation * UnitQuaternion::from_scaled_axis(0.05 * normal3(&mut self.rng));
        let t = Translation3::from(truth.translation.vector + 0.1 * normal3(&mut self.rng));
        self.keys.push(self.values.insert(Isometry3::from_parts(t, r)));
        self.truth.push(truth);
    }

    fn link(&mut self, name: &str, links: &[(usize, usize)]) -> depthcal_solver::BatchId {
        let mut batch = Batch::new(name).with_noise(Noise::diagonal(NOISE).unwrap());
        for (a, b) in links {
            let noise = Isometry3::from_parts(
                Translation3::from(0.05 * normal3(&mut self.rng)),
                UnitQuaternion::from_scaled_axis(0.01 * normal3(&mut self.rng)),
            );
            batch.push(Between(self.truth[*a].inverse() * self.truth[*b] * noise), (self.keys[*a], self.keys[*b]));
        }
        self.graph.add_batch(batch)
    }
}

fn options() -> Options {
    Options { cost_tolerance: 1e-13, ..Options::default() }
}

/// Both converge to the same minimum: costs agree to a relative 1e-13, values to the square root of that.
fn same(solution: &Solution, graph: &Graph, start: &Values) {
    let anew = minimize(graph, start.clone(), &options()).unwrap();
    assert!(solution.report.converged && anew.report.converged, "{}\n{}", solution.report, anew.report);
    assert!((solution.report.cost - anew.report.cost).abs() < 1e-9 * anew.report.cost, "{}", solution.report);
    for id in start.ids() {
        let (a, b) = (solution.values.state(id).unwrap(), anew.values.state(id).unwrap());
        let close = a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-5);
        assert!(close || start.state(id).unwrap() == a, "{a:?} {b:?}");
    }
}

#[test]
fn symbolic_factorisations_are_kept_while_they_fit() {
    for linear_solver in [LinearSolver::Auto, LinearSolver::SparseCholesky] {
        let mut poses = Poses::grid(12);
        let mut session = Session::new(Options { linear_solver, ..options() });
        let mut solve = |poses: &mut Poses, analyses: usize| {
            let start = poses.values.clone();
            let solution = session.solve(&poses.graph, start.clone()).unwrap();
            assert_eq!(solution.report.linear_solver.solver, LinearSolver::SparseCholesky);
            assert_eq!(solution.report.linear_solver.symbolic_analyses, analyses, "{}", solution.report);
            same(&solution, &poses.graph, &start);
            poses.values = solution.values;
            solution.report.iterations
        };
        let cold = solve(&mut poses, 1);
        // Without a change the first step is the last.
        assert!(solve(&mut poses, 0) <= 2 && cold > 2);
        // A second measurement between poses that are linked.
        let again = poses.link("again", &[(0, 1), (5, 17), (100, 101)]);
        solve(&mut poses, 0);
        // Poses that were not linked.
        let closure = poses.link("closure", &[(0, 143)]);
        solve(&mut poses, 1);
        assert!(poses.graph.remove_batch(closure) && poses.graph.remove_batch(again));
        solve(&mut poses, 0);
        // One more pose.
        poses.add(Isometry3::translation(12.0, 12.0, 0.0));
        poses.link("new", &[(143, 144)]);
        solve(&mut poses, 1);
        // And one fewer.
        let gone = poses.keys[30];
        assert_eq!(poses.graph.remove_variable(gone), 4);
        let before = *poses.values.get(gone);
        solve(&mut poses, 1);
        assert_eq!(*poses.values.get(gone), before);
        assert_eq!(session.symbolic_analyses(), 4);
    }
}

#[test]
fn schur_complements_and_qr_keep_theirs_too() {
    let common::Bundle { mut graph, values, camera, points, .. } =
        common::bundle(8, 60, 0.5, depthcal_solver::Loss::Trivial, 2);
    for (linear_solver, new_rows) in [(LinearSolver::SparseSchur, 0), (LinearSolver::SparseQr, 1)] {
        let mut session = Session::new(Options { linear_solver, ..options() });
        let first = session.solve(&graph, values.clone()).unwrap();
        assert_eq!(first.report.linear_solver.symbolic_analyses, 1);
        let second = session.solve(&graph, first.values.clone()).unwrap();
        assert_eq!(second.report.linear_solver.symbolic_analyses, 0);
        let ids: Vec<VariableId> = points.iter().map(|p| p.id()).collect();
        graph.eliminate(ids);
        let batch = graph.add_batch(Prior::isotropic("camera", camera, *second.values.get(camera), 1.0).unwrap());
        let third = session.solve(&graph, second.values).unwrap();
        // For QR, more rows mean another sparsity pattern.
        assert_eq!(third.report.linear_solver.symbolic_analyses, new_rows, "{linear_solver:?}");
        same(&third, &graph, &values);
        graph.remove_batch(batch);
    }
}

#[test]
fn groups_that_are_taken_away_are_gone_for_all() {
    let mut poses = Poses::grid(4);
    let doubled = poses.link("doubled", &[(0, 1), (1, 2), (2, 3), (3, 7)]);
    let residuals = poses.graph.residuals(doubled, &poses.values).unwrap();
    assert_eq!(poses.graph.retain_groups(doubled, |g, _| g % 2 == 0), 2);
    assert_eq!(poses.graph.retain_groups(doubled, |g, batch| batch.variables(g)[0] == poses.keys[2].id()), 1);
    // Only the third is left.
    assert_eq!(poses.graph.residuals(doubled, &poses.values).unwrap(), residuals[12..18]);
    assert_eq!(poses.graph.retain_groups(doubled, |_, _| true), 0);
    assert_eq!(poses.graph.remove_variable(poses.keys[2]), 1 + 3);
    assert!(poses.graph.residuals(doubled, &poses.values).unwrap().is_empty());
    let solution = minimize(&poses.graph, poses.values.clone(), &options()).unwrap();
    assert_eq!(solution.report.residuals, 6 * (24 - 3) + 6);
    assert_eq!(solution.report.unknowns, 15 * 6);
}
