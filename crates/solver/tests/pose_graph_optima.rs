//! Chordal start, factors and certificate of pose graphs: known truth, differences, and the 16 measured graphs that come with
//! SE-Sync.

use std::process::Command;

use depthcal_solver::pose_graph::{
    BetweenPlane, BetweenSpace, ChordalPlane, ChordalSpace, PoseGraphError, RelativePose, RigidMotion, certify,
    chordal_objective, chordal_start, tree_start,
};
use depthcal_solver::{Batch, Damping, Graph, Options, Values, check_jacobians, minimize};
use nalgebra::{Isometry3, SMatrix, SVector, Vector2, Vector3};
use proptest::prelude::*;

use crate::common::{normal, normal3, rng};
use crate::g2o::G2oGraph;
use crate::measured::{measured, skipped};
use crate::pose_factors::{Objective, PoseGraph};
use crate::synthetic;

fn generated(kind: &str, count: usize) -> G2oGraph {
    G2oGraph::parse("generated".as_ref(), synthetic::generate(kind, count).unwrap().as_bytes()).unwrap()
}

fn options() -> Options {
    Options { damping: Damping::WhenNeeded { tau: 1e-4 }, cost_tolerance: 1e-8, ..Options::default() }
}

/// Random poses, and exact relative poses between neighbours and some others.
fn exact<const D: usize>(poses: Vec<RigidMotion<D>>, chords: &[usize]) -> (Vec<RigidMotion<D>>, Vec<RelativePose<D>>) {
    let n = poses.len();
    let links = (1..n).map(|i| (i - 1, i)).chain(chords.iter().enumerate().map(|(i, c)| (i % n, (i + 2 + c) % n)));
    let measurements = links.filter(|(a, b)| a != b).enumerate().map(|(k, (from, to))| {
        let motion = poses[from].inverse().compose(&poses[to]);
        RelativePose { from, to, motion, kappa: 1.0 + k as f64, tau: 3.0 + 0.5 * k as f64 }
    });
    let measurements = measurements.collect();
    // Poses as seen from the first one.
    (poses.iter().map(|pose| poses[0].inverse().compose(pose)).collect(), measurements)
}

fn plane(count: usize, seed: u64) -> Vec<RigidMotion<2>> {
    let mut rng = rng(seed);
    (0..count).map(|_| Vector3::new(5.0 * normal(&mut rng), normal(&mut rng), 2.0 * normal(&mut rng)).into()).collect()
}

fn space(count: usize, seed: u64) -> Vec<RigidMotion<3>> {
    let mut rng = rng(seed);
    (0..count).map(|_| Isometry3::new(5.0 * normal3(&mut rng), 1.5 * normal3(&mut rng)).into()).collect()
}

fn farthest<const D: usize>(a: &[RigidMotion<D>], b: &[RigidMotion<D>]) -> f64 {
    let distance = |a: &RigidMotion<D>, b: &RigidMotion<D>| -> f64 {
        (a.rotation - b.rotation).amax().max((a.translation - b.translation).amax())
    };
    a.iter().zip(b).map(|(a, b)| distance(a, b)).fold(0.0, f64::max)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    /// Without noise the relaxation is exact, whatever the rotations.
    #[test]
    fn starts_from_exact_measurements_are_the_truth(
        count in 2_usize..20, seed in 0_u64..1000, chords in proptest::collection::vec(0_usize..17, 0..20),
    ) {
        let (truth, measurements) = exact(plane(count, seed), &chords);
        prop_assert!(farthest(&chordal_start(count, &measurements).unwrap(), &truth) < 1e-8);
        prop_assert!(farthest(&tree_start(count, &measurements).unwrap(), &truth) < 1e-10);
        prop_assert!(chordal_objective(&truth, &measurements).unwrap() < 1e-20);
        let (truth, measurements) = exact(space(count, seed), &chords);
        prop_assert!(farthest(&chordal_start(count, &measurements).unwrap(), &truth) < 1e-8);
        prop_assert!(farthest(&tree_start(count, &measurements).unwrap(), &truth) < 1e-10);
    }
}

/// The start against the same linear least squares as dense matrices, by a singular value decomposition.
#[test]
fn the_chordal_start_is_that_of_dense_least_squares() {
    let (_, mut measurements) = exact(space(9, 4), &[3, 1, 2, 5, 2, 7]);
    let mut rng = rng(8);
    for m in &mut measurements {
        let noise = RigidMotion::from(Isometry3::new(0.3 * normal3(&mut rng), 0.3 * normal3(&mut rng)));
        m.motion = m.motion.compose(&noise);
    }
    let start = chordal_start(9, &measurements).unwrap();
    let least_squares = |rows: &dyn Fn(&mut SMatrix<f64, 1000, 24>, &mut SMatrix<f64, 1000, 3>)| {
        let (mut a, mut b) = (Box::new(SMatrix::zeros()), Box::new(SMatrix::zeros()));
        rows(&mut a, &mut b);
        nalgebra::DMatrix::from_fn(1000, 24, |i, j| a[(i, j)])
            .svd(true, true)
            .solve(&nalgebra::DMatrix::from_fn(1000, 3, |i, j| b[(i, j)]), 1e-12)
            .unwrap()
    };
    // R_jᵀ = R_ijᵀ R_iᵀ, three rows a measurement, 24 unknown rows of transposed rotations.
    let transposed = least_squares(&|a, b| {
        for (k, m) in measurements.iter().enumerate() {
            let w = m.kappa.sqrt();
            for r in 0..3 {
                for c in 0..3 {
                    let mut put = |pose: usize, value: f64| match pose.checked_sub(1) {
                        Some(pose) => a[(3 * k + r, 3 * pose + c)] += value,
                        None => b[(3 * k + r, c)] -= value,
                    };
                    put(m.to, if r == c { w } else { 0.0 });
                    put(m.from, -w * m.motion.rotation[(c, r)]);
                }
            }
        }
    });
    for (i, pose) in start.iter().enumerate().skip(1) {
        let relaxed = transposed.fixed_view::<3, 3>(3 * (i - 1), 0).transpose();
        // The polar factor M (Mᵀ M)^−½, another way to the nearest rotation.
        let eigen = (relaxed.transpose() * relaxed).symmetric_eigen();
        let root = eigen.eigenvectors
            * SMatrix::<f64, 3, 3>::from_diagonal(&eigen.eigenvalues.map(|l| 1.0 / l.sqrt()))
            * eigen.eigenvectors.transpose();
        assert!((pose.rotation - relaxed * root).amax() < 1e-9, "pose {i}");
    }
    // The gradient of Σ τ ‖t_j − t_i − R_i t_ij‖² vanishes for every translation but the first.
    let mut gradient = [Vector3::zeros(); 9];
    for m in &measurements {
        let (from, to) = (&start[m.from], &start[m.to]);
        let e = (to.translation - from.translation - from.rotation * m.motion.translation) * m.tau;
        gradient[m.to] += e;
        gradient[m.from] -= e;
    }
    assert!(gradient[1..].iter().all(|g| g.amax() < 1e-9), "{gradient:?}");
}

#[test]
fn graphs_that_cannot_be_started_say_why() {
    let (_, measurements) = exact(plane(6, 1), &[]);
    assert!(matches!(chordal_start(7, &measurements), Err(PoseGraphError::Disconnected { pose: 6 })));
    assert!(matches!(chordal_start(5, &measurements), Err(PoseGraphError::Ends { from: 4, to: 5, count: 5 })));
    let mut broken = measurements.clone();
    broken[2].motion.translation = Vector2::new(f64::NAN, 0.0);
    assert!(chordal_start(6, &broken).is_err());
    let singular = [[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let message = RelativePose::in_plane(3, 4, [0.0; 3], &singular).unwrap_err().to_string();
    assert!(message.contains("translation of the relative pose of 4 from 3"), "{message}");
    assert_eq!(chordal_start::<3>(1, &[]).unwrap(), [RigidMotion::identity()]);
    assert!(chordal_start::<3>(0, &[]).unwrap().is_empty());
}

/// Derivatives of all four factors against differences, and the squares of the chordal ones against the definition.
#[test]
fn factors_have_the_derivatives_and_squares_of_their_definition() {
    let mut rng = rng(5);
    for round in 0..20 {
        let mut values = Values::new();
        // Errors up to some 2 rad: far from where all forms of the error agree.
        let size = 0.05 * f64::from(round);
        let flat: [Vector3<f64>; 2] = std::array::from_fn(|_| normal3(&mut rng));
        let between = RigidMotion::from(flat[0]).inverse().compose(&flat[1].into());
        let noise = RigidMotion::from(normal3(&mut rng) * size);
        let measured = RelativePose { from: 0, to: 1, motion: between.compose(&noise), kappa: 7.0, tau: 0.5 };
        let keys = flat.map(|pose| values.insert(pose));
        let mut graph = Graph::new();
        let chordal = graph.add(ChordalPlane::new(&measured), (keys[0], keys[1]));
        let expected = measured.chordal_error(&flat[0].into(), &flat[1].into());
        let cost = graph.batch_cost(chordal, &values).unwrap();
        assert!((2.0 * cost - expected).abs() < 1e-12 * (1.0 + expected), "{cost} {expected}");
        let information = [[2.0, 0.3, 0.1], [0.3, 4.0, -0.2], [0.1, -0.2, 9.0]];
        graph.add(BetweenPlane::new(Vector3::from(measured.motion).into(), &information), (keys[0], keys[1]));

        let poses: [Isometry3<f64>; 2] = std::array::from_fn(|_| Isometry3::new(normal3(&mut rng), normal3(&mut rng)));
        let noise = Isometry3::new(normal3(&mut rng) * size, normal3(&mut rng) * size);
        let motion = poses[0].inverse() * poses[1] * noise;
        let measured = RelativePose { from: 0, to: 1, motion: motion.into(), kappa: 7.0, tau: 0.5 };
        let keys = poses.map(|pose| values.insert(pose));
        let chordal = graph.add(ChordalSpace::new(&measured), (keys[0], keys[1]));
        let expected = measured.chordal_error(&poses[0].into(), &poses[1].into());
        let cost = graph.batch_cost(chordal, &values).unwrap();
        assert!((2.0 * cost - expected).abs() < 1e-12 * (1.0 + expected), "{cost} {expected}");
        let root = SMatrix::<f64, 6, 6>::from_fn(|i, j| if i == j { 2.0 } else { 0.1 * (i as f64 - j as f64) });
        let information: [[f64; 6]; 6] = (root.transpose() * root).into();
        graph.add(BetweenSpace::new(&motion, &information), (keys[0], keys[1]));
        // Central differences with this step are off by some 1e-9 of values up to a hundred.
        let worst = check_jacobians(&graph, &values, 1e-5).unwrap();
        assert!(worst.len() == 4 && worst.iter().all(|w| w.error < 1e-6), "{worst:?}");
    }
}

/// The least objective of a small noisy graph is found from everywhere, and the certificate says so; that of another
/// stationary point, of worse poses, and of poses that satisfy another graph, does not.
#[test]
fn certificates_tell_the_optimum_from_other_poses() {
    for kind in ["manhattan", "sphere", "torus"] {
        let file = generated(kind, 100);
        let mut problem = PoseGraph::new(&file, Objective::Chordal).unwrap();
        problem.start(true).unwrap();
        let solution =
            minimize(&problem.graph, problem.values.clone(), &Options { cost_tolerance: 1e-14, ..options() }).unwrap();
        let certificate = problem.certify(&solution.values).unwrap();
        assert!((certificate.objective - 2.0 * solution.report.cost).abs() < 1e-9 * certificate.objective);
        assert!(certificate.relative_gap().unwrap() < 1e-6, "{kind} {certificate:?}");
        // The start has a higher objective, and the bound that it gives may not lie above the optimum.
        let start = problem.certify(&problem.values).unwrap();
        assert!(start.objective > 1.001 * certificate.objective, "{kind}");
        assert!(start.lower_bound.is_none_or(|bound| bound <= certificate.objective * (1.0 + 1e-9)), "{kind}");
    }
}

/// A ring whose poses turn once more than measured is a local minimum, which only the certificate tells from the optimum.
#[test]
fn a_local_minimum_is_not_certified() {
    let n = 20;
    let ring = |turns: f64| -> Vec<RigidMotion<2>> {
        let angle = |i: usize| std::f64::consts::TAU * turns * i as f64 / n as f64;
        (0..n).map(|i| Vector3::new(angle(i).cos(), angle(i).sin(), angle(i)).into()).collect()
    };
    let truth = ring(1.0);
    let measurements: Vec<_> = (0..n)
        .map(|i| {
            let (from, to) = (i, (i + 1) % n);
            let motion = truth[from].inverse().compose(&truth[to]);
            // Exact, but for one translation, so that the least objective is not zero.
            let shift = if i == 0 { Vector2::new(0.02, 0.01) } else { Vector2::zeros() };
            RelativePose {
                from,
                to,
                motion: RigidMotion { translation: motion.translation + shift, ..motion },
                kappa: 100.0,
                tau: 1.0,
            }
        })
        .collect();
    let mut objectives = Vec::new();
    for start in [truth.clone(), ring(2.0)] {
        let mut values = Values::new();
        let keys: Vec<_> = start.iter().map(|pose| values.insert(Vector3::from(*pose))).collect();
        let mut batch = Batch::new("ring");
        measurements.iter().for_each(|m| batch.push(ChordalPlane::new(m), (keys[m.from], keys[m.to])));
        let mut graph = Graph::new();
        graph.add_batch(batch);
        graph.fix(keys[0]);
        let exact = Options { cost_tolerance: 1e-14, ..options() };
        let solution = minimize(&graph, values, &exact).unwrap();
        assert!(solution.report.converged, "{}", solution.report);
        let poses: Vec<RigidMotion<2>> = keys.iter().map(|key| (*solution.values.get(*key)).into()).collect();
        let certificate = certify(&poses, &measurements).unwrap();
        objectives.push(certificate);
    }
    assert!(objectives[0].relative_gap().unwrap() < 1e-6, "{objectives:?}");
    assert!(objectives[1].objective > 10.0 * objectives[0].objective, "{objectives:?}");
    assert!(objectives[1].relative_gap().is_none_or(|gap| gap > 0.5), "{objectives:?}");
}

/// Graphs as they come with SE-Sync.
const GRAPHS: [&str; 16] = [
    "CSAIL",
    "MIT",
    "ais2klinik",
    "city10000",
    "cubicle",
    "intel",
    "kitti_00",
    "kitti_02",
    "kitti_05",
    "manhattan",
    "parking-garage",
    "smallGrid3D",
    "sphere2500",
    "sphere_bignoise_vertex3",
    "tinyGrid3D",
    "torus3D",
];

#[test]
fn measured_graphs_reach_certified_optima_within_eight_iterations() {
    for name in GRAPHS {
        let Some(path) = measured(&format!("../peers/graphs/{name}.g2o.xz")) else { continue };
        let Ok(output) = Command::new("xz").arg("-dc").arg(&path).output() else {
            return skipped("the program xz is not installed");
        };
        let file = G2oGraph::parse(&path, &output.stdout).unwrap();
        let mut problem = PoseGraph::new(&file, Objective::Chordal).unwrap();
        problem.start(true).unwrap();
        let solution = minimize(&problem.graph, problem.values.clone(), &options()).unwrap();
        let report = &solution.report;
        assert!(report.converged && report.iterations <= 8, "{name} {report}");
        let objective = 2.0 * report.cost;
        // The bound is best at the exact optimum, and holds for all poses.
        let exact = Options { cost_tolerance: 1e-14, ..options() };
        let best = minimize(&problem.graph, solution.values, &exact).unwrap();
        let bound = problem.certify(&best.values).unwrap().lower_bound.unwrap();
        assert!(objective - bound < 1e-6 * objective, "{name} {objective} {bound}");
    }
}

/// Gauss–Newton with trust takes no more iterations than Levenberg–Marquardt from the beginning where the start is good, and
/// still converges from a bad one, where full steps fail.
#[test]
fn damping_when_needed_trusts_and_recovers() {
    let run = |damping: Damping, chordal: bool| {
        let mut problem = PoseGraph::new(&generated("sphere", 400), Objective::Chordal).unwrap();
        problem.start(chordal).unwrap();
        if !chordal {
            // Far from any truth: hardly a rotation is less than 1 rad off.
            let mut rng = rng(3);
            for id in problem.values.ids().skip(1) {
                let delta: SVector<f64, 6> = SVector::from_fn(|_, _| 1.5 * normal(&mut rng));
                problem.values.retract(id, delta.as_slice());
            }
        }
        minimize(&problem.graph, problem.values, &Options { damping, ..options() }).unwrap().report
    };
    let (trust, caution) = (Damping::WhenNeeded { tau: 1e-4 }, Damping::Nielsen { tau: 1e-4 });
    let good = run(trust, true);
    assert!(good.converged && good.trace.iter().all(|i| i.accepted && i.damping < 1e-12), "{good}");
    assert!(good.iterations <= run(caution, true).iterations, "{good}");
    let bad = run(trust, false);
    assert!(bad.trace.iter().any(|i| !i.accepted), "{bad}");
    assert!(bad.trace.iter().any(|i| i.accepted && i.damping >= 1e-4), "{bad}");
    // Descent to a minimum, which need not be the global one.
    assert!(bad.cost < 1e-2 * bad.cost0 && bad.cost > (1.0 - 1e-6) * good.cost, "{bad}");
}
