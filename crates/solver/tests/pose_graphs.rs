//! Pose graphs of the example against an answer found another way.
//!
//! The other way: a dense Gauss–Newton method over homogeneous matrices, with rotations moved by the matrix exponential from
//! the left and derivatives by differences. It shares neither parameterisation nor derivatives nor linear algebra.

use crate::g2o::G2oGraph;
use crate::{pose_factors, synthetic};
use depthcal_solver::{Covariance, CovarianceOptions, LinearSolver, Options, Solution, minimize};
use nalgebra::{DMatrix, DVector, Matrix3, Matrix4, Rotation3, Vector3};

fn read(text: &str) -> G2oGraph {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("graph.g2o");
    std::fs::write(&path, text).unwrap();
    G2oGraph::read(&path).unwrap()
}

fn solve(file: &G2oGraph) -> Solution {
    let (graph, values) = pose_factors::build(file.clone()).unwrap();
    let solution = minimize(&graph, values, &Options { cost_tolerance: 1e-13, ..Options::default() }).unwrap();
    assert!(solution.report.converged, "{}", solution.report);
    solution
}

/// A measured relative pose: ends, homogeneous matrix, information of (t, rotation vector), and whether it is one of g2o in
/// space, where the rotation counts by the quaternion's vector part.
struct Edge {
    ends: (usize, usize),
    measured: Matrix4<f64>,
    information: DMatrix<f64>,
}

fn homogeneous(rotation: Matrix3<f64>, t: Vector3<f64>) -> Matrix4<f64> {
    let mut m = rotation.to_homogeneous();
    m.fixed_view_mut::<3, 1>(0, 3).copy_from(&t);
    m
}

fn from_quaternion([w, x, y, z]: [f64; 4]) -> Matrix3<f64> {
    Matrix3::new(
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - w * z),
        2.0 * (x * z + w * y),
        2.0 * (x * y + w * z),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - w * x),
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    )
}

/// Homogeneous matrices and edges of a file.
fn matrices(file: &G2oGraph) -> (Vec<Matrix4<f64>>, Vec<Edge>) {
    let plane = |[x, y, angle]: [f64; 3]| {
        homogeneous(*Rotation3::from_axis_angle(&Vector3::z_axis(), angle).matrix(), Vector3::new(x, y, 0.0))
    };
    let space = |t: [f64; 3], q| homogeneous(from_quaternion(q), t.into());
    let poses = file.se2_vertices.iter().map(|v| plane(v.pose));
    let poses = poses.chain(file.se3_vertices.iter().map(|v| space(v.translation, v.rotation)));
    let edges = file.se2_edges.iter().map(|e| Edge {
        ends: (e.from, e.to),
        measured: plane(e.measurement),
        information: DMatrix::from_fn(3, 3, |i, j| e.information[i][j]),
    });
    let edges = edges.chain(file.se3_edges.iter().map(|e| Edge {
        ends: (e.from, e.to),
        measured: space(e.translation, e.rotation),
        information: DMatrix::from_fn(6, 6, |i, j| e.information[i][j]),
    }));
    (poses.collect(), edges.collect())
}

/// The error of an edge, in g2o's form.
fn error(edge: &Edge, poses: &[Matrix4<f64>]) -> DVector<f64> {
    let relative = poses[edge.ends.0].try_inverse().unwrap() * poses[edge.ends.1];
    let r: Matrix3<f64> = relative.fixed_view::<3, 3>(0, 0).into();
    let measured: Matrix3<f64> = edge.measured.fixed_view::<3, 3>(0, 0).into();
    if edge.information.nrows() == 3 {
        let remaining = measured.transpose() * r;
        let t = relative.column(3) - edge.measured.column(3);
        return DVector::from_vec(vec![t[0], t[1], remaining[(1, 0)].atan2(remaining[(0, 0)])]);
    }
    let remaining = edge.measured.try_inverse().unwrap() * relative;
    let w = 0.5 * (remaining[(0, 0)] + remaining[(1, 1)] + remaining[(2, 2)] + 1.0).max(0.0).sqrt();
    let v = |i: usize, j: usize| (remaining[(i, j)] - remaining[(j, i)]) / (4.0 * w);
    DVector::from_vec(vec![remaining[(0, 3)], remaining[(1, 3)], remaining[(2, 3)], v(2, 1), v(0, 2), v(1, 0)])
}

fn cost(edges: &[Edge], poses: &[Matrix4<f64>]) -> f64 {
    edges.iter().map(|e| 0.5 * error(e, poses).dot(&(&e.information * error(e, poses)))).sum()
}

/// A pose moved from the left: x, y, angle about z or translation and rotation vector.
fn moved(pose: &Matrix4<f64>, delta: &[f64]) -> Matrix4<f64> {
    let (t, w) = match *delta {
        [x, y, angle] => (Vector3::new(x, y, 0.0), Vector3::new(0.0, 0.0, angle)),
        [x, y, z, a, b, c] => (Vector3::new(x, y, z), Vector3::new(a, b, c)),
        _ => panic!("a step of three or six"),
    };
    homogeneous(w.cross_matrix().exp(), t) * pose
}

/// The minimum with the first pose held.
fn dense(file: &G2oGraph) -> (f64, Vec<Matrix4<f64>>) {
    let (mut poses, edges) = matrices(file);
    let d = edges[0].information.nrows();
    let n = d * (poses.len() - 1);
    let mut damping = 1e-3;
    let mut best = cost(&edges, &poses);
    for _ in 0..200 {
        let (mut h, mut g) = (DMatrix::zeros(n, n), DVector::zeros(n));
        for edge in &edges {
            let e = error(edge, &poses);
            let ends = [edge.ends.0, edge.ends.1];
            let jacobians = ends.map(|end| {
                DMatrix::from_columns(&Vec::from_iter((0..d).map(|k| {
                    let side = |sign: f64| {
                        let mut delta = vec![0.0; d];
                        delta[k] = sign * 1e-6;
                        let mut other = [poses[ends[0]], poses[ends[1]]];
                        let index = usize::from(end == ends[1]);
                        other[index] = moved(&other[index], &delta);
                        let local = Edge { ends: (0, 1), measured: edge.measured, information: DMatrix::zeros(d, d) };
                        error(&local, &other)
                    };
                    (side(1.0) - side(-1.0)) / 2e-6
                })))
            });
            for (a, ja) in ends.iter().zip(&jacobians).filter(|(a, _)| **a > 0) {
                let wj = ja.transpose() * &edge.information;
                let mut target = g.rows_mut(d * (a - 1), d);
                target += &wj * &e;
                for (b, jb) in ends.iter().zip(&jacobians).filter(|(b, _)| **b > 0) {
                    let mut target = h.view_mut((d * (a - 1), d * (b - 1)), (d, d));
                    target += &wj * jb;
                }
            }
        }
        loop {
            let mut damped = h.clone();
            (0..n).for_each(|i| damped[(i, i)] += damping * h[(i, i)]);
            let step = -damped.cholesky().unwrap().solve(&g);
            let mut trial = poses.clone();
            for (i, pose) in trial.iter_mut().enumerate().skip(1) {
                *pose = moved(pose, &step.as_slice()[d * (i - 1)..d * i]);
            }
            let trial_cost = cost(&edges, &trial);
            if trial_cost <= best {
                let gain = best - trial_cost;
                (poses, best, damping) = (trial, trial_cost, 0.2 * damping);
                if gain < 1e-12 * best {
                    return (best, poses);
                }
                break;
            }
            damping *= 10.0;
            if damping > 1e6 {
                return (best, poses);
            }
        }
    }
    panic!("the dense method does not converge")
}

#[test]
fn the_minimum_is_that_of_a_dense_method() {
    for (kind, count) in [("manhattan", 120), ("sphere", 64), ("torus", 49)] {
        let file = read(&synthetic::generate(kind, count).unwrap());
        let solution = solve(&file);
        let (cost, poses) = dense(&file);
        assert!((solution.report.cost - cost).abs() < 1e-8 * cost, "{kind} {cost} {}", solution.report);
        assert!(solution.report.cost0 > 10.0 * cost, "{kind}: the start has to be poor");
        for (id, pose) in solution.values.ids().zip(&poses) {
            // x, y, angle, or a unit quaternion i, j, k, w and the translation.
            let state = solution.values.state(id).unwrap();
            let t = if state.len() == 3 { [state[0], state[1], 0.0] } else { [state[4], state[5], state[6]] };
            let expected = pose.column(3);
            assert!((0..3).all(|i| (t[i] - expected[i]).abs() < 1e-4), "{kind} {t:?} {expected}");
        }
    }
}

#[test]
fn larger_graphs_scatter_as_their_noise_says() {
    for (kind, count, d) in [("manhattan", 2000, 3), ("sphere", 900, 6), ("torus", 900, 6)] {
        let file = read(&synthetic::generate(kind, count).unwrap());
        let solution = solve(&file);
        let used = &solution.report.linear_solver;
        assert_eq!((used.solver, used.forced), (LinearSolver::SparseCholesky, false), "{kind} {used:?}");
        let edges = file.se2_edges.len() + file.se3_edges.len();
        let freedom = (solution.report.residuals - solution.report.unknowns) as f64;
        assert_eq!(solution.report.residuals, d * edges);
        // 2 · cost is χ² with as many degrees of freedom: five standard deviations, √(2 n) each.
        assert!(
            (2.0 * solution.report.cost - freedom).abs() < 5.0 * (2.0 * freedom).sqrt(),
            "{kind} {}",
            solution.report
        );
    }
}

#[test]
fn marginals_of_a_pose_graph_come_from_its_sparse_factor() {
    let file = read(&synthetic::generate("sphere", 225).unwrap());
    let solution = solve(&file);
    let (mut graph, _) = pose_factors::build(file).unwrap();
    let ids: Vec<_> = [3, 224, 100].map(|i| solution.values.ids().nth(i).unwrap()).to_vec();
    for free in [false, true] {
        if free {
            graph.unfix(solution.values.ids().next().unwrap());
        }
        let options = CovarianceOptions { pseudo_inverse: free, ..CovarianceOptions::default() };
        let whole = Covariance::compute(&graph, &solution.values, &options).unwrap();
        let selected = Covariance::selected(&graph, &solution.values, &ids, &options).unwrap();
        assert_eq!((whole.nullity(), selected.nullity()), if free { (6, 6) } else { (0, 0) });
        let (a, b) = (whole.joint(&ids), selected.joint(&ids));
        assert!((&a - &b).amax() < 1e-7 * a.amax(), "{free} {}", (&a - &b).amax() / a.amax());
    }
}
