//! Bounded components: the constrained optimum is found, by all methods and linear solvers.

use crate::common::{Bundle, Exponential, bundle, normal, rng};
use depthcal_solver::{
    Batch, Covariance, CovarianceOptions, Factor, Graph, Key, LinearSolver, Loss, Method, Options, Over,
    Preconditioner, Prior, Scalar, SolveError, StructureError, Values, minimize,
};
use nalgebra::{DMatrix, DVector, Isometry3, SMatrix, SVector, UnitQuaternion, Vector2, Vector3};

const METHODS: [Method; 3] = [Method::LevenbergMarquardt, Method::DogLeg { radius: 10.0 }, Method::GaussNewton];
const LINEAR_SOLVERS: [LinearSolver; 6] = [
    LinearSolver::Dense,
    LinearSolver::SparseCholesky,
    LinearSolver::DenseSchur,
    LinearSolver::SparseSchur,
    LinearSolver::ConjugateGradients(Preconditioner::SchurJacobi),
    LinearSolver::SparseQr,
];

/// aᵀ (p, q) − b.
struct Row {
    a: SVector<f64, 5>,
    b: f64,
}

impl Factor<1> for Row {
    type Variables = (Vector2<f64>, Vector3<f64>);

    fn residual<T: Scalar>(&self, (p, q): Over<Self::Variables, T>) -> SVector<T, 1> {
        let sum = p[0] * self.a[0] + p[1] * self.a[1] + q[0] * self.a[2] + q[1] * self.a[3] + q[2] * self.a[4];
        SVector::<T, 1>::new(sum - self.b)
    }
}

/// The minimum of ½ ‖A x − b‖² in a box, by trying all combinations of components on their bounds.
fn optimum(a: &DMatrix<f64>, b: &DVector<f64>, lower: &[f64; 5], upper: &[f64; 5]) -> (f64, DVector<f64>) {
    let mut best = (f64::INFINITY, DVector::zeros(5));
    for choice in 0..3_usize.pow(5) {
        let state: Vec<usize> = (0..5).map(|i| choice / 3_usize.pow(i) % 3).collect();
        let mut x = DVector::from_fn(5, |i, _| [0.0, lower[i], upper[i]][state[i]]);
        let free: Vec<usize> = (0..5).filter(|i| state[*i] == 0).collect();
        if !x.iter().all(|x| x.is_finite()) {
            continue;
        }
        if !free.is_empty() {
            let columns = a.select_columns(&free);
            let solution = (columns.tr_mul(&columns)).try_inverse().unwrap() * columns.tr_mul(&(b - a * &x));
            free.iter().zip(solution.iter()).for_each(|(i, s)| x[*i] = *s);
        }
        let cost = 0.5 * (a * &x - b).norm_squared();
        if (0..5).all(|i| lower[i] <= x[i] && x[i] <= upper[i]) && cost < best.0 {
            best = (cost, x);
        }
    }
    best
}

#[test]
fn random_linear_problems_in_a_box() {
    let mut active = 0;
    for seed in 0..60 {
        let mut rng = rng(seed);
        // Strongly coupled columns: Newton steps lead off bounds in other directions than the gradient.
        let mix = SMatrix::<f64, 5, 5>::from_fn(|_, _| normal(&mut rng)) + SMatrix::repeat(1.0);
        let mut values = Values::new();
        let (p, q) = (values.insert(Vector2::new(0.3, 0.1)), values.insert(Vector3::new(-0.2, 5.0, 0.0)));
        let mut batch = Batch::new("rows");
        let (mut a, mut b) = (DMatrix::zeros(9, 5), DVector::zeros(9));
        for i in 0..9 {
            let row = mix * SVector::<f64, 5>::from_fn(|_, _| normal(&mut rng));
            b[i] = 3.0 * normal(&mut rng);
            a.row_mut(i).copy_from(&row.transpose());
            batch.push(Row { a: row, b: b[i] }, (p, q));
        }
        let mut graph = Graph::new();
        graph.add_batch(batch);
        graph.eliminate([q]);
        let (mut lower, mut upper) = ([0.0; 5], [0.0; 5]);
        for i in 0..5 {
            lower[i] = if i == 3 { f64::NEG_INFINITY } else { -0.3 * normal(&mut rng).abs() };
            upper[i] = if i == 4 { f64::INFINITY } else { 0.3 * normal(&mut rng).abs() };
            match i {
                0 | 1 => graph.bound(p, i, lower[i], upper[i]),
                _ => graph.bound(q, i - 2, lower[i], upper[i]),
            }
        }
        let (cost, x) = optimum(&a, &b, &lower, &upper);
        active += (0..5).filter(|i| x[*i] == lower[*i] || x[*i] == upper[*i]).count();
        for method in METHODS {
            for linear_solver in LINEAR_SOLVERS {
                let options = Options { method, linear_solver, cost_tolerance: 1e-14, ..Options::default() };
                let solution = minimize(&graph, values.clone(), &options).unwrap();
                let report = &solution.report;
                assert!(report.converged, "{seed} {method:?} {linear_solver:?} {report}");
                assert!((report.cost - cost).abs() < 1e-9 * (1.0 + cost), "{seed} {method:?} {cost} {report}");
                let got: Vec<f64> = solution.values.get(p).iter().chain(solution.values.get(q)).copied().collect();
                for i in 0..5 {
                    assert!(lower[i] <= got[i] && got[i] <= upper[i], "never outside, not by one bit");
                    assert!((got[i] - x[i]).abs() < 1e-5 * (1.0 + x.amax()), "{seed} {method:?} {got:?} {x}");
                }
            }
        }
    }
    assert!(active > 60, "bounds that do not matter would prove nothing");
}

fn curve() -> (Graph, Values, Key<Vector2<f64>>) {
    let mut values = Values::new();
    let key = values.insert(Vector2::new(1.0, 0.5));
    let mut batch = Batch::new("curve");
    for i in 0..20 {
        let x = 0.1 * f64::from(i);
        batch.push(Exponential { x, y: 2.0 * (1.5 * x).exp() + (f64::from(i)).sin() * 0.1 }, (key,));
    }
    let mut graph = Graph::new();
    graph.add_batch(batch);
    (graph, values, key)
}

#[test]
fn a_curve_with_a_bounded_rate() {
    let (mut graph, values, key) = curve();
    graph.bound(key, 1, f64::NEG_INFINITY, 1.2);
    for method in METHODS {
        let solution = minimize(&graph, values.clone(), &Options { method, ..Options::default() }).unwrap();
        assert!(solution.report.converged, "{}", solution.report);
        // With the rate on its bound, the factor is a linear fit.
        let (mut ey, mut ee) = (0.0, 0.0);
        for i in 0..20 {
            let x = 0.1 * f64::from(i);
            let (e, y) = ((1.2 * x).exp(), 2.0 * (1.5 * x).exp() + (f64::from(i)).sin() * 0.1);
            ey += e * y;
            ee += e * e;
        }
        let p = solution.values.get(key);
        assert_eq!(p[1], 1.2);
        assert!((p[0] - ey / ee).abs() < 1e-8, "{p}");
    }
}

#[test]
fn bounds_that_do_not_matter_change_nothing() {
    let (mut graph, values, key) = curve();
    let free = minimize(&graph, values.clone(), &Options::default()).unwrap();
    graph.bound(key, 0, -100.0, 100.0);
    graph.bound(key, 1, -100.0, f64::INFINITY);
    let bounded = minimize(&graph, values.clone(), &Options::default()).unwrap();
    assert_eq!(free.values.get(key), bounded.values.get(key));
    let covariance = |graph: &Graph| Covariance::compute(graph, &free.values, &CovarianceOptions::default()).unwrap();
    let with = covariance(&graph).marginal(key);
    assert!(graph.unbound(key, 0) && graph.unbound(key, 1) && !graph.unbound(key, 1));
    assert_eq!(with, covariance(&graph).marginal(key));
}

#[test]
fn a_start_outside_is_moved_onto_the_bound() {
    let mut values = Values::new();
    let key = values.insert(Vector2::new(9.0, -9.0));
    let mut graph = Graph::new();
    graph.add_batch(Prior::isotropic("prior", key, Vector2::new(2.0, -20.0), 1.0).unwrap());
    graph.bound(key, 0, -1.0, 1.0);
    graph.bound(key, 1, -3.0, 3.0);
    let solution = minimize(&graph, values, &Options::default()).unwrap();
    assert_eq!(*solution.values.get(key), Vector2::new(1.0, -3.0));
    assert!(solution.report.converged && solution.report.cost0 == 0.5 * (1.0 + 17.0 * 17.0), "{}", solution.report);
}

/// An active bound on the shared camera and one on a point have the effect of fixing both there.
#[test]
fn active_bounds_of_a_bundle_are_like_fixed_components() {
    let Bundle { mut graph, mut values, camera, points, .. } = bundle(6, 60, 0.5, Loss::Trivial, 5);
    let mut fixed = graph.clone();
    graph.bound(camera, 0, 0.0, 480.0);
    let free = minimize(&fixed, values.clone(), &Options::default()).unwrap();
    let z = free.values.get(points[7]).z + 0.2;
    graph.bound(points[7], 2, z, f64::INFINITY);
    let mut results = Vec::new();
    for threads in [1, 3] {
        for linear_solver in LINEAR_SOLVERS {
            let options = Options { threads, linear_solver, ..Options::default() };
            let solution = minimize(&graph, values.clone(), &options).unwrap();
            assert!(solution.report.converged, "{}", solution.report);
            assert_eq!((solution.values.get(camera).x, solution.values.get(points[7]).z), (480.0, z));
            results.push((format!("{:?}", solution.values), solution));
        }
    }
    for i in 0..LINEAR_SOLVERS.len() {
        assert_eq!(results[i].0, results[i + LINEAR_SOLVERS.len()].0, "same bits for any number of threads");
    }
    let solution = &results[0].1;
    values.set_coordinate(camera.id(), 0, 480.0);
    values.set_coordinate(points[7].id(), 2, z);
    fixed.fix_partly(camera, &[true, false]);
    fixed.fix_partly(points[7], &[false, false, true]);
    let expected = minimize(&fixed, values, &Options::default()).unwrap();
    assert!((solution.report.cost - expected.report.cost).abs() < 1e-8 * expected.report.cost);
    assert!((solution.values.get(camera) - expected.values.get(camera)).norm() < 1e-5);
    let ids = [camera.id(), points[7].id(), points[8].id()];
    let joint = |graph: &Graph| {
        let covariance = Covariance::compute(graph, &solution.values, &CovarianceOptions::default()).unwrap();
        (covariance.joint(&ids), covariance.degrees_of_freedom())
    };
    assert_eq!(joint(&graph), joint(&fixed));
    assert_eq!(joint(&graph).0[(0, 0)], 0.0);
}

#[test]
fn senseless_bounds_are_named() {
    let mut values = Values::new();
    let key = values.insert(Isometry3::identity());
    let rotation = values.insert(UnitQuaternion::identity());
    let mut graph = Graph::new();
    graph.add_batch(Prior::isotropic("prior", key, Isometry3::translation(1.0, 2.0, 3.0), 1.0).unwrap());
    graph.label(key, "the pose");
    let refused = |change: &dyn Fn(&mut Graph)| {
        let mut graph = graph.clone();
        change(&mut graph);
        match minimize(&graph, values.clone(), &Options::default()).map(|s| s.report) {
            Err(SolveError::Structure(e @ StructureError::Bound { .. })) => e.to_string(),
            other => panic!("{other:?}"),
        }
    };
    assert!(refused(&|g| g.bound(key, 3, 1.0, -1.0)).contains("component 3 of the pose: the lower bound 1"));
    assert!(refused(&|g| g.bound(key, 3, f64::NAN, 1.0)).contains("lower bound NaN"));
    assert!(refused(&|g| g.bound(key, 6, 0.0, 1.0)).contains("no such component"));
    assert!(refused(&|g| g.bound(key, 2, 0.0, 1.0)).contains("no coordinate"));
    assert!(refused(&|g| g.bound(rotation, 2, 0.0, 1.0)).contains("Variable::coordinate"));
    graph.bound(key, 4, 0.0, 1.0);
    let solution = minimize(&graph, values, &Options::default()).unwrap();
    assert!((solution.values.get(key).translation.vector - Vector3::new(1.0, 1.0, 3.0)).norm() < 1e-9);
}
