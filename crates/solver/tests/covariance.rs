//! Covariances against repeated estimation and against invariances.

use crate::common::{self, Bundle, bundle, normal, rng};
use crate::g2o::G2oGraph;
use crate::{pose_factors, synthetic};
use depthcal_solver::{
    Batch, Covariance, CovarianceError, CovarianceOptions, Factor, Graph, LinearSolver, Loss, Options, Over, Prior,
    Scalar, Values, Variable, minimize,
};
use nalgebra::{DMatrix, DVector, SVector};
use rand::RngExt;

/// The estimate's deviation from the truth in the tangent coordinates of the estimate, cameras and some points.
fn deviation(b: &Bundle, values: &Values) -> DVector<f64> {
    let mut all = Vec::new();
    let mut delta = [0.0; 6];
    values.get(b.camera).local(b.truth.get(b.camera), &mut delta);
    all.extend_from_slice(&delta[..2]);
    for pose in &b.poses[1..] {
        values.get(*pose).local(b.truth.get(*pose), &mut delta);
        all.extend_from_slice(&delta);
    }
    for point in &b.points[..3] {
        values.get(*point).local(b.truth.get(*point), &mut delta);
        all.extend_from_slice(&delta[..3]);
    }
    DVector::from_vec(all)
}

#[test]
fn five_hundred_solves_scatter_as_the_covariance_says() {
    const RUNS: usize = 500;
    let noise = 0.03;
    let mut deviations = Vec::new();
    let mut predicted = DMatrix::zeros(0, 0);
    let mut mahalanobis = 0.0;
    let mut variance_factor = 0.0;
    let mut free = Vec::new();
    for run in 0..RUNS {
        // The scene is the same in all runs: only the start and the noise follow the seed.
        let b = scene(noise, 1000 + run as u64);
        let solution = minimize(&b.graph, b.values.clone(), &Options::default()).unwrap();
        assert!(solution.report.converged, "{}", solution.report);
        let covariance = Covariance::compute(&b.graph, &solution.values, &CovarianceOptions::default()).unwrap();
        let mut ids = vec![b.camera.id()];
        ids.extend(b.poses[1..].iter().map(|p| p.id()));
        ids.extend(b.points[..3].iter().map(|p| p.id()));
        let joint = covariance.joint(&ids);
        free = (0..joint.nrows()).filter(|i| joint[(*i, *i)] > 0.0).collect();
        let joint = joint.select_rows(&free).select_columns(&free);
        let d = deviation(&b, &solution.values).select_rows(&free);
        mahalanobis += d.dot(&(joint.clone().try_inverse().unwrap() * &d)) / RUNS as f64;
        variance_factor += covariance.variance_factor() / RUNS as f64;
        if run == 0 {
            predicted = joint;
        }
        deviations.push(d);
    }
    let n = free.len();
    // The fixed component of the second pose has no variance.
    assert_eq!(n, 2 + 5 + 6 + 6 + 9);
    // χ² of n degrees of freedom: mean n, standard deviation of the mean √(2n/500); five of them, and the nonlinearity.
    assert!(
        (mahalanobis - n as f64).abs() < 5.0 * (2.0 * n as f64 / RUNS as f64).sqrt() + 0.02 * n as f64,
        "{mahalanobis} {n}"
    );
    assert!((variance_factor - 1.0).abs() < 0.05, "{variance_factor}");
    let mean = deviations.iter().sum::<DVector<f64>>() / RUNS as f64;
    for i in 0..n {
        for j in 0..=i {
            let sample: f64 =
                deviations.iter().map(|d| (d[i] - mean[i]) * (d[j] - mean[j])).sum::<f64>() / (RUNS - 1) as f64;
            let scale = (predicted[(i, i)] * predicted[(j, j)]).sqrt();
            // A sample covariance of 500 scatters by up to √(2/500) = 0.063 of the scale.
            assert!((sample - predicted[(i, j)]).abs() < 0.3 * scale, "{i} {j} {sample} {}", predicted[(i, j)]);
        }
    }
}

/// Four cameras and sixteen points whose truth does not depend on the seed.
fn scene(noise: f64, seed: u64) -> Bundle {
    let fixed = bundle(4, 16, 0.0, Loss::Trivial, 77);
    let mut b = bundle(4, 16, 0.0, Loss::Trivial, 77);
    let mut rng = rng(seed);
    let mut batch =
        depthcal_solver::Batch::new("projections").with_noise(depthcal_solver::Noise::isotropic(noise).unwrap());
    for pose in &fixed.poses {
        for point in &fixed.points {
            let exact = depthcal_solver::Factor::residual::<f64>(
                &common::Projection { observed: nalgebra::Vector2::zeros() },
                (
                    depthcal_solver::Pose::constant(fixed.truth.get(*pose)),
                    *fixed.truth.get(fixed.camera),
                    *fixed.truth.get(*point),
                ),
            );
            let observed = exact + noise * nalgebra::Vector2::from_fn(|_, _| normal(&mut rng));
            batch.push(common::Projection { observed }, (*pose, b.camera, *point));
        }
    }
    b.graph = Graph::new();
    b.graph.add_batch(batch);
    b.graph.fix(b.poses[0]);
    b.graph.fix_partly(b.poses[1], &[false, false, false, true, false, false]);
    b
}

#[test]
fn a_pseudo_inverse_obeys_the_penrose_conditions_and_ignores_what_is_eliminated() {
    let Bundle { mut graph, values, poses, camera, points, .. } = bundle(4, 9, 0.5, Loss::Cauchy { scale: 2.0 }, 8);
    let values = minimize(&graph, values, &Options::default()).unwrap().values;
    let mut ids: Vec<_> = poses.iter().map(|p| p.id()).collect();
    ids.push(camera.id());
    ids.extend(points.iter().map(|p| p.id()));
    let regular = Covariance::compute(&graph, &values, &CovarianceOptions::default()).unwrap().joint(&ids);
    graph.unfix(poses[0]);
    graph.unfix(poses[1]);
    let options = CovarianceOptions { pseudo_inverse: true, ..CovarianceOptions::default() };
    let by_points = Covariance::compute(&graph, &values, &options).unwrap();
    assert_eq!(by_points.nullity(), 7);
    let g = by_points.joint(&ids);
    let scale = g.amax();
    graph.eliminate(poses.iter().copied());
    let by_poses = Covariance::compute(&graph, &values, &options).unwrap().joint(&ids);
    assert!((&g - by_poses).amax() < 1e-6 * scale);
    // H from the residuals themselves. G H G = G, H G H = H, G H and H G symmetric.
    let h = hessian(&graph, &values, &ids);
    let near = |a: &DMatrix<f64>, b: &DMatrix<f64>| (a - b).amax() < 1e-6 * b.amax();
    assert!(near(&(&h * &g * &h), &h));
    assert!(near(&(&g * &h * &g), &g));
    let projector = &g * &h;
    assert!((&projector - projector.transpose()).amax() < 1e-6);
    // The camera's parameters do not depend on the gauge, and neither does their variance.
    for i in 24..26 {
        assert!((g[(i, i)] / regular[(i, i)] - 1.0).abs() < 1e-6);
    }
}

/// Jᵀ W J by evaluating all groups.
fn hessian(graph: &Graph, values: &Values, ids: &[depthcal_solver::VariableId]) -> DMatrix<f64> {
    let n = ids.iter().map(|id| values.dim(*id)).sum();
    let mut h = DMatrix::zeros(n, n);
    for (_, batch) in graph.batches() {
        for group in 0..batch.group_count() {
            let columns: Vec<usize> = batch
                .variables(group)
                .iter()
                .flat_map(|v| {
                    let index = ids.iter().position(|id| id == v).unwrap();
                    let first: usize = ids[..index].iter().map(|id| values.dim(*id)).sum();
                    first..first + values.dim(*v)
                })
                .collect();
            let rows = batch.row_count(group);
            let mut r = vec![0.0; rows];
            let mut j = vec![0.0; rows * columns.len()];
            batch.evaluate(group, values, &mut r, Some(&mut j)).unwrap();
            for (k, r) in r.chunks(batch.residual_dim()).enumerate() {
                let weight = batch.loss().evaluate(r.iter().map(|x| x * x).sum())[1];
                for row in k * r.len()..(k + 1) * r.len() {
                    let row = &j[row * columns.len()..(row + 1) * columns.len()];
                    for (a, ca) in row.iter().zip(&columns) {
                        for (b, cb) in row.iter().zip(&columns) {
                            h[(*ca, *cb)] += weight * a * b;
                        }
                    }
                }
            }
        }
    }
    h
}

#[test]
fn a_covariance_does_not_depend_on_the_way_to_the_minimum() {
    let Bundle { graph, values, camera, .. } = bundle(5, 25, 0.5, Loss::Trivial, 9);
    let mut marginals = Vec::new();
    for linear_solver in [LinearSolver::DenseSchur, LinearSolver::SparseCholesky] {
        let options = Options { linear_solver, cost_tolerance: 1e-14, ..Options::default() };
        let solution = minimize(&graph, values.clone(), &options).unwrap();
        let covariance = Covariance::compute(&graph, &solution.values, &CovarianceOptions::default()).unwrap();
        assert!((covariance.variance_factor() - 1.0).abs() < 0.3);
        marginals.push(covariance.marginal(camera));
    }
    assert!((&marginals[0] - &marginals[1]).amax() < 1e-6 * marginals[0].amax());
}

#[test]
fn variables_without_factors_are_not_known_at_all() {
    let Bundle { graph, mut values, camera, poses, .. } = bundle(3, 12, 0.5, Loss::Trivial, 10);
    let lonely = values.insert(nalgebra::Vector2::new(1.0, 2.0));
    let covariance = Covariance::compute(&graph, &values, &CovarianceOptions::default()).unwrap();
    let joint = covariance.joint(&[lonely.id(), camera.id(), poses[0].id()]);
    assert_eq!(joint.shape(), (10, 10));
    assert!(joint[(0, 0)].is_infinite() && joint[(0, 1)] == 0.0 && joint[(0, 2)] == 0.0);
    assert!(joint[(2, 2)] > 0.0);
    // A fixed variable has no variance.
    assert_eq!(joint.view((4, 4), (6, 6)).amax(), 0.0);
}

#[test]
fn selected_covariances_are_those_of_the_whole() {
    let Bundle { mut graph, values, poses, camera, points, .. } = bundle(5, 30, 0.5, Loss::Huber { delta: 1.0 }, 14);
    let values = minimize(&graph, values, &Options::default()).unwrap().values;
    // Not in the order of the problem, some of them fixed wholly or in part.
    let ids = [points[7].id(), poses[1].id(), camera.id(), points[0].id(), poses[0].id(), poses[4].id()];
    let options = CovarianceOptions { pseudo_inverse: true, ..CovarianceOptions::default() };
    // With the gauge fixed, with it free, and with it free and a variable that no factor determines.
    for (case, nullity) in [0, 7, 8].into_iter().enumerate() {
        if case == 1 {
            graph.unfix(poses[0]);
            graph.unfix(poses[1]);
        }
        if case == 2 {
            // Depth along the ray of a point that only one pose sees.
            let last_pose = poses[2].id();
            for (batch, _) in graph.clone().batches() {
                let point = points[7].id();
                graph.retain_groups(batch, |g, b| {
                    !b.variables(g).contains(&point) || b.variables(g).contains(&last_pose)
                });
            }
        }
        let whole = Covariance::compute(&graph, &values, &options).unwrap();
        let selected = Covariance::selected(&graph, &values, &ids, &options).unwrap();
        assert_eq!((whole.nullity(), selected.nullity()), (nullity, nullity));
        assert_eq!(whole.degrees_of_freedom(), selected.degrees_of_freedom());
        let (a, b) = (whole.joint(&ids), selected.joint(&ids));
        // The condition number of H is some 1e8, rounding errors 1e-16 of that.
        assert!((&a - &b).amax() < 1e-6 * a.amax(), "{case} {}", (&a - &b).amax() / a.amax());
        assert!(selected.marginal(points[1]).iter().all(|c| c.is_nan()), "a variable that was not selected");
        if nullity > 0 {
            let strict = CovarianceOptions::default();
            let Err(CovarianceError::RankDeficient { directions }) =
                Covariance::selected(&graph, &values, &ids, &strict)
            else {
                panic!("the gauge is free")
            };
            assert_eq!(directions.len(), nullity);
        }
    }
}

/// Every block that the sparse factor has, against the inverse of the dense matrix: graphs with a supernodal factor, chains and
/// trees with a simplicial one, and grids of scalars, such as fields.
#[test]
fn marginals_are_blocks_of_the_dense_inverse() {
    let compare = |name: &str, graph: &Graph, values: &Values| {
        let options = CovarianceOptions::default();
        let whole = Covariance::compute(graph, values, &options).unwrap();
        let sparse = Covariance::marginals(graph, values, &options).unwrap();
        for id in values.ids() {
            let (a, b) = (whole.marginal(id), sparse.marginal(id));
            assert!((&a - &b).amax() <= 1e-9 * a.amax(), "{name} {id:?} {a} {b}");
        }
        let mut linked = 0;
        for (_, batch) in graph.batches() {
            for group in 0..batch.group_count() {
                let ids = batch.variables(group);
                let (a, b) = (whole.joint(ids), sparse.joint(ids));
                assert!((&a - &b).amax() <= 1e-9 * a.amax(), "{name} {ids:?} {a} {b}");
                linked += usize::from(ids.len() > 1);
            }
        }
        assert!(linked > 0, "{name}");
        sparse
    };
    for (kind, count) in [("manhattan", 300), ("sphere", 144), ("torus", 100)] {
        let text = synthetic::generate(kind, count).unwrap();
        let file = G2oGraph::parse("generated".as_ref(), text.as_bytes()).unwrap();
        let (graph, values) = pose_factors::build(file).unwrap();
        compare(kind, &graph, &values);
    }
    let mut rng = rng(11);
    for (width, height, links) in [(1, 2, 0), (1, 60, 0), (1, 40, 12), (12, 9, 0), (7, 8, 5)] {
        let mut values = Values::new();
        let mut graph = Graph::new();
        let nodes: Vec<_> =
            (0..width * height).map(|_| values.insert(SVector::<f64, 1>::new(normal(&mut rng)))).collect();
        let mut step = Batch::new("steps");
        let mut link = |a: usize, b: usize| step.push(Step(1.0 + (a % 3) as f64), (nodes[a], nodes[b]));
        for i in 0..width * height {
            if i % width + 1 < width {
                link(i, i + 1);
            }
            if i + width < width * height {
                link(i, i + width);
            }
        }
        for _ in 0..links {
            let (a, b) = (rng.random_range(0..width * height), rng.random_range(0..width * height));
            if a != b {
                link(a, b);
            }
        }
        graph.add_batch(step);
        let free = Covariance::marginals(&graph, &values, &CovarianceOptions::default());
        assert!(matches!(free, Err(CovarianceError::RankDeficient { directions }) if directions.len() == 1));
        graph.add_batch(Prior::isotropic("first", nodes[0], SVector::<f64, 1>::zeros(), 0.1).unwrap());
        let sparse = compare("grid", &graph, &values);
        if (width, height, links) == (1, 60, 0) {
            // The ends of a chain share no factor, and whatever the order of elimination no entry of L.
            assert!(sparse.joint(&[nodes[0].id(), nodes[59].id()])[(0, 1)].is_nan());
        }
    }
}

/// w (b − a).
struct Step(f64);

impl Factor<1> for Step {
    type Variables = (SVector<f64, 1>, SVector<f64, 1>);

    fn residual<T: Scalar>(&self, (a, b): Over<Self::Variables, T>) -> SVector<T, 1> {
        SVector::<T, 1>::new((b[0] - a[0]) * self.0)
    }
}
