//! Small problems with known solutions.

use crate::common::{self, Bundle, Distance, Exponential, bundle, normal, rng};
use depthcal_solver::{
    Batch, Covariance, CovarianceError, CovarianceOptions, Damping, EvaluationError, Factor, FactorBatch, Graph,
    Interrupt, LinearSolver, Loss, Method, Noise, Options, Over, Prior, Scalar, SolveError, StructureError,
    Termination, Values, VariableId, check_jacobians, minimize,
};
use nalgebra::{DMatrix, DVector, Isometry3, SVector, Unit, UnitQuaternion, Vector1, Vector2, Vector3};

fn exponential(noise: f64, outliers: bool) -> (Graph, Values, depthcal_solver::Key<Vector2<f64>>) {
    let mut rng = rng(1);
    let mut values = Values::new();
    let key = values.insert(Vector2::new(1.0, 0.0));
    let mut batch = Batch::new("curve");
    if outliers {
        batch = batch.with_loss(Loss::Tukey { scale: 0.5 });
    }
    for i in 0..50 {
        let x = 0.1 * f64::from(i);
        let wrong = if outliers && i % 10 == 3 { 3.0 } else { 0.0 };
        batch.push(Exponential { x, y: 2.0 * (-0.3 * x).exp() + noise * normal(&mut rng) + wrong }, (key,));
    }
    let mut graph = Graph::new();
    graph.add_batch(batch);
    (graph, values, key)
}

#[test]
fn a_curve_without_noise_is_found_to_rounding() {
    for damping in [Damping::default(), Damping::Radius { initial: 1e4, max: 1e16 }] {
        let (graph, values, key) = exponential(0.0, false);
        let solution = minimize(&graph, values, &Options { damping, ..Options::default() }).unwrap();
        assert!(solution.report.converged, "{}", solution.report);
        assert!((solution.values.get(key) - Vector2::new(2.0, -0.3)).norm() < 1e-9);
        assert!(solution.report.iterations < 20);
        assert_eq!(solution.report.residuals, 50);
        assert_eq!(solution.report.unknowns, 2);
    }
}

#[test]
fn a_redescending_loss_ignores_outliers() {
    let (graph, values, key) = exponential(0.01, true);
    // Start near the minimum: a redescending loss has other local minima.
    let mut values = values;
    values.set(key, Vector2::new(2.1, -0.25));
    let solution = minimize(&graph, values, &Options::default()).unwrap();
    assert!(solution.report.converged, "{}", solution.report);
    // 45 good points of noise 0.01: the parameters are known to a few thousandths.
    assert!((solution.values.get(key) - Vector2::new(2.0, -0.3)).norm() < 0.02);
}

#[test]
fn a_bundle_without_noise_is_found_to_rounding_by_every_linear_solver() {
    for linear_solver in [
        LinearSolver::Auto,
        LinearSolver::Dense,
        LinearSolver::SparseCholesky,
        LinearSolver::DenseSchur,
        LinearSolver::SparseSchur,
    ] {
        let Bundle { graph, values, truth, points, camera, poses } = bundle(6, 30, 0.0, Loss::Trivial, 2);
        let solution = minimize(&graph, values, &Options { linear_solver, ..Options::default() }).unwrap();
        assert!(solution.report.converged, "{linear_solver:?}: {}", solution.report);
        for point in points {
            assert!((solution.values.get(point) - truth.get(point)).norm() < 1e-7, "{}", solution.report);
        }
        assert!((solution.values.get(camera) - truth.get(camera)).norm() < 1e-4);
        // The fixed component of a partly fixed pose has not changed by a bit.
        assert_eq!(solution.values.get(poses[1]).translation.x, truth.get(poses[1]).translation.x);
    }
}

#[test]
fn points_are_eliminated_where_there_are_many_and_a_choice_can_be_forced() {
    let Bundle { mut graph, values, poses, .. } = bundle(6, 60, 0.5, Loss::Trivial, 3);
    let automatic = minimize(&graph, values.clone(), &Options::default()).unwrap();
    assert_eq!(automatic.report.linear_solver.eliminated_variables, 60);
    assert_eq!(automatic.report.linear_solver.reduced_dim, 5 * 6 - 1 + 2);
    graph.eliminate(poses.iter().copied());
    let forced = minimize(&graph, values, &Options::default()).unwrap();
    assert_eq!(forced.report.linear_solver.eliminated_variables, 5);
    assert!((forced.report.cost / automatic.report.cost - 1.0).abs() < 1e-9);
}

#[test]
fn what_is_not_determined_is_named() {
    let Bundle { mut graph, values, poses, .. } = bundle(4, 20, 0.5, Loss::Trivial, 4);
    for (i, pose) in poses.iter().enumerate() {
        graph.label(*pose, format!("pose {i}"));
    }
    let values = minimize(&graph, values, &Options::default()).unwrap().values;
    assert!(Covariance::compute(&graph, &values, &CovarianceOptions::default()).is_ok());
    // With free scale there is one direction; with nothing fixed there are seven.
    graph.unfix(poses[1]);
    let Err(CovarianceError::RankDeficient { directions }) =
        Covariance::compute(&graph, &values, &CovarianceOptions::default())
    else {
        panic!("the scale is not determined")
    };
    assert_eq!(directions.len(), 1);
    // Scaling the scene about the first camera moves the other cameras' centres and all points.
    assert!(directions[0].components.iter().any(|c| c.label == "pose 1" && c.component >= 3));
    assert!(directions[0].components.iter().all(|c| c.variable != poses[0].id()));
    graph.unfix(poses[0]);
    let error = Covariance::compute(&graph, &values, &CovarianceOptions::default()).unwrap_err();
    assert!(matches!(&error, CovarianceError::RankDeficient { directions } if directions.len() == 7), "{error}");
    assert!(error.to_string().contains("7 combinations"));
}

#[test]
fn the_sum_of_two_numbers_says_nothing_about_their_difference() {
    struct Sum([VariableId; 2]);
    impl FactorBatch for Sum {
        fn name(&self) -> &str {
            "sum"
        }
        fn group_count(&self) -> usize {
            1
        }
        fn variables(&self, _: usize) -> &[VariableId] {
            &self.0
        }
        fn row_count(&self, _: usize) -> usize {
            1
        }
        fn evaluate(&self, _: usize, _: &Values, r: &mut [f64], j: Option<&mut [f64]>) -> Result<(), EvaluationError> {
            r[0] = 0.0;
            if let Some(j) = j {
                j.copy_from_slice(&[1.0, 1.0]);
            }
            Ok(())
        }
    }
    let mut values = Values::new();
    let (a, b) = (values.insert(DVector::from_element(1, 0.0)), values.insert(DVector::from_element(1, 0.0)));
    let mut graph = Graph::new();
    graph.add_batch(Sum([a.id(), b.id()]));
    graph.label(a, "a");
    graph.label(b, "b");
    let Err(CovarianceError::RankDeficient { directions }) =
        Covariance::compute(&graph, &values, &CovarianceOptions::default())
    else {
        panic!("the difference is not determined")
    };
    let c = &directions[0].components;
    assert_eq!(c.len(), 2);
    assert!((c[0].value + c[1].value).abs() < 1e-12 && (c[0].value.abs() - 0.5_f64.sqrt()).abs() < 1e-12);
    // The pseudo-inverse of [1 1; 1 1] is a quarter of it.
    let options = CovarianceOptions { pseudo_inverse: true, ..CovarianceOptions::default() };
    let covariance = Covariance::compute(&graph, &values, &options).unwrap();
    let joint = covariance.joint(&[a.id(), b.id()]);
    assert!((joint - DMatrix::from_element(2, 2, 0.25)).amax() < 1e-12);
    assert_eq!(covariance.nullity(), 1);
}

#[test]
fn errors_say_what_is_wrong() {
    struct Wall(VariableId, f64);
    impl FactorBatch for Wall {
        fn name(&self) -> &str {
            "wall"
        }
        fn group_count(&self) -> usize {
            1
        }
        fn variables(&self, _: usize) -> &[VariableId] {
            std::slice::from_ref(&self.0)
        }
        fn row_count(&self, _: usize) -> usize {
            1
        }
        // ln x, defined for x > 0 only.
        fn evaluate(&self, _: usize, v: &Values, r: &mut [f64], j: Option<&mut [f64]>) -> Result<(), EvaluationError> {
            let x = v.key::<DVector<f64>>(self.0).map_or(0.0, |k| v.get(k)[0]);
            if x <= 0.0 {
                return Err(EvaluationError::new("not positive"));
            }
            r[0] = x.ln() - self.1;
            if let Some(j) = j {
                j[0] = 1.0 / x;
            }
            Ok(())
        }
    }
    let mut values = Values::new();
    let x = values.insert(DVector::from_element(1, -1.0));
    let mut graph = Graph::new();
    graph.add_batch(Wall(x.id(), -3.0));
    let error = minimize(&graph, values.clone(), &Options::default()).unwrap_err();
    assert!(matches!(&error, SolveError::Start(f) if f.batch == "wall" && f.group == 0), "{error}");
    assert!(error.to_string().contains("not positive"));
    // Starting inside the domain, the first full step leads out of it and is rejected.
    values.set(x, DVector::from_element(1, 5.0));
    let solution = minimize(&graph, values.clone(), &Options::default()).unwrap();
    assert!(solution.report.converged, "{}", solution.report);
    assert!(solution.report.trace.iter().any(|i| !i.accepted && i.trial_cost.is_infinite()));
    assert!((solution.values.get(x)[0] - (-3.0_f64).exp()).abs() < 1e-9);
    // A key of other values.
    let mut other = Values::new();
    let _ = other.insert(1.0_f64 * Vector3::zeros());
    graph.fix_partly(x, &[true, false]);
    let error = minimize(&graph, values, &Options::default()).unwrap_err();
    assert!(matches!(error, SolveError::Structure(StructureError::MaskLength { dim: 1, mask: 2, .. })));
    let error = minimize(&graph, Values::new(), &Options::default()).unwrap_err();
    assert!(matches!(error, SolveError::Structure(StructureError::UnknownVariable { .. })));
}

#[test]
fn nothing_to_estimate_is_no_error() {
    let (mut graph, values, key) = exponential(0.1, false);
    graph.fix(key);
    let solution = minimize(&graph, values, &Options::default()).unwrap();
    assert_eq!(solution.report.termination, Termination::NothingToEstimate);
    assert_eq!(solution.report.cost, graph.cost(&solution.values).unwrap());
    assert!(minimize(&Graph::new(), Values::new(), &Options::default()).unwrap().report.converged);
}

#[test]
fn priors_pull_every_kind_of_variable_to_their_mean() {
    let mut values = Values::new();
    let mut graph = Graph::new();
    let mut rng = rng(5);
    let rotation = UnitQuaternion::from_euler_angles(0.3, -0.2, 0.9);
    let pose = Isometry3::new(Vector3::new(1.0, 2.0, 3.0), Vector3::new(0.4, 0.5, -0.6));
    let direction = Unit::new_normalize(Vector3::new(0.1, -0.7, -0.6));
    let vector = DVector::from_fn(4, |_, _| normal(&mut rng));
    let r = values.insert(UnitQuaternion::identity());
    let p = values.insert(Isometry3::identity());
    let d = values.insert(Unit::new_normalize(Vector3::new(1.0, 0.3, 0.2)));
    let v = values.insert(DVector::zeros(4));
    graph.add_batch(Prior::isotropic("rotation", r, rotation, 0.1).unwrap());
    graph.add_batch(Prior::diagonal("pose", p, pose, &[0.1, 0.2, 0.3, 1.0, 2.0, 3.0]).unwrap());
    graph.add_batch(Prior::isotropic("direction", d, direction, 0.05).unwrap());
    let a = DMatrix::from_fn(4, 4, |_, _| normal(&mut rng));
    graph.add_batch(Prior::square_root_information("vector", v, vector.clone(), a.clone()).unwrap());
    for error in check_jacobians(&graph, &values, 1e-5).unwrap() {
        // Differences of curvature-limited functions with a step of 1e-5: errors of 1e-10 relative.
        assert!(error.error < 1e-7, "{error:?}");
    }
    let solution = minimize(&graph, values, &Options::default()).unwrap();
    assert!(solution.report.converged, "{}", solution.report);
    let optimum = &solution.values;
    assert!(optimum.get(r).angle_to(&rotation) < 1e-9);
    assert!((optimum.get(p).to_homogeneous() - pose.to_homogeneous()).amax() < 1e-9);
    assert!((optimum.get(d).into_inner() - direction.into_inner()).norm() < 1e-9);
    assert!((optimum.get(v) - vector).norm() < 1e-9);
    // At the mean a prior's covariance is the given one.
    let covariance = Covariance::compute(&graph, optimum, &CovarianceOptions::default()).unwrap();
    let expected = DVector::from_vec(vec![0.1, 0.2, 0.3, 1.0, 2.0, 3.0]);
    assert!((covariance.standard_deviations(p) - expected).amax() < 1e-9);
    let information = a.transpose() * a;
    assert!((information * covariance.marginal(v) - DMatrix::identity(4, 4)).amax() < 1e-9);
}

#[test]
fn batches_may_be_removed_and_added_and_the_rest_solved_again() {
    let mut values = Values::new();
    let a = values.insert(Vector3::new(0.0, 0.0, 0.0));
    let b = values.insert(Vector3::new(1.0, 1.0, 0.5));
    let mut graph = Graph::new();
    graph.add_batch(Prior::isotropic("a", a, Vector3::zeros(), 1.0).unwrap());
    graph.add_batch(Prior::diagonal("b", b, Vector3::zeros(), &[1.0, 1.0]).unwrap());
    let mut far = Batch::new("far").with_noise(Noise::isotropic(0.05).unwrap());
    far.push(Distance(2.0), (a, b));
    let far = graph.add_batch(far);
    let first = minimize(&graph, values, &Options::default()).unwrap();
    assert!(first.report.converged, "{}", first.report);
    // The prior gives way to the much more certain distance.
    assert!((first.values.get(a) - first.values.get(b)).norm() > 1.95);
    assert!(graph.remove_batch(far) && !graph.remove_batch(far));
    graph.add(Distance(5.0), (a, b));
    graph.fix(a);
    let second = minimize(&graph, first.values, &Options::default()).unwrap();
    assert!(second.report.converged);
    let distance = (second.values.get(a) - second.values.get(b)).norm();
    // z of b is free: the distance can be met exactly.
    assert!((distance - 5.0).abs() < 1e-6, "{distance} {}", second.report);
}

#[test]
fn every_method_reaches_the_same_minimum() {
    let common::Bundle { graph, values, .. } = common::bundle(5, 60, 0.5, Loss::Huber { delta: 2.0 }, 21);
    let solve = |method| {
        let solution = minimize(&graph, values.clone(), &Options { method, ..Options::default() }).unwrap();
        assert!(solution.report.converged, "{}", solution.report);
        solution.report.cost
    };
    let expected = solve(Method::LevenbergMarquardt);
    // Start with a trust region far too small, a good one, and one far too large.
    for method in [1e-3, 1e2, 1e9].map(|radius| Method::DogLeg { radius }).into_iter().chain([Method::GaussNewton]) {
        let cost = solve(method);
        // The cost has converged to a relative 1e-9.
        assert!((cost - expected).abs() < 1e-8 * expected, "{method:?} {cost} {expected}");
    }
    let (graph, values, key) = exponential(0.0, false);
    for method in [Method::DogLeg { radius: 1.0 }, Method::GaussNewton] {
        let solution = minimize(&graph, values.clone(), &Options { method, ..Options::default() }).unwrap();
        assert!((solution.values.get(key) - Vector2::new(2.0, -0.3)).norm() < 1e-9, "{}", solution.report);
    }
}

#[test]
fn an_interrupted_solver_returns_the_best_so_far() {
    /// x² + 1 = 0, which raises the flag after some evaluations.
    struct Raising(Interrupt, std::sync::atomic::AtomicUsize);
    impl Factor<1> for Raising {
        type Variables = (Vector1<f64>,);
        fn residual<T: Scalar>(&self, (x,): Over<Self::Variables, T>) -> SVector<T, 1> {
            if self.1.fetch_add(1, std::sync::atomic::Ordering::Relaxed) == 8 {
                self.0.raise();
            }
            SVector::<T, 1>::new(x[0] * x[0] + 1.0)
        }
    }
    let mut values = Values::new();
    let x = values.insert(Vector1::new(100.0));
    let interrupt = Interrupt::new();
    let mut graph = Graph::new();
    graph.add(Raising(interrupt.clone(), Default::default()), (x,));
    let options = Options { interrupt: Some(interrupt.clone()), ..Options::default() };
    let solution = minimize(&graph, values.clone(), &options).unwrap();
    assert!(interrupt.is_raised());
    assert_eq!(solution.report.termination, Termination::Interrupted);
    assert!(!solution.report.converged && solution.report.iterations > 0);
    assert!(solution.report.cost < solution.report.cost0);
    assert_eq!(graph.cost(&solution.values).unwrap().to_bits(), solution.report.cost.to_bits());
}

/// A parameter of 10¹² whose residuals care about its last digits does not end the search before the others have moved: steps are
/// compared by what they do to the residuals, not by the norm of all parameters.
#[test]
fn a_huge_parameter_does_not_end_the_search() {
    struct Both {
        x: f64,
        y: f64,
    }
    impl Factor<2> for Both {
        type Variables = (SVector<f64, 1>, SVector<f64, 1>);

        fn residual<T: Scalar>(&self, (huge, small): Over<Self::Variables, T>) -> SVector<T, 2> {
            SVector::<T, 2>::new((huge[0] - 1e12) * 1e-3, (small[0] * self.x).exp() - self.y)
        }
    }
    let mut values = Values::new();
    let huge = values.insert(SVector::<f64, 1>::new(1e12 + 5e3));
    let small = values.insert(SVector::<f64, 1>::new(3e-7));
    let mut graph = Graph::new();
    for x in [1.0, 2.0, 3.0] {
        graph.add(Both { x: 1e6 * x, y: (0.8 * x).exp() }, (huge, small));
    }
    let options = Options { gradient_tolerance: 0.0, cost_tolerance: 0.0, ..Options::default() };
    let solution = minimize(&graph, values, &options).unwrap();
    assert!(solution.report.converged, "{}", solution.report);
    assert!((solution.values.get(small)[0] - 8e-7).abs() < 1e-15, "{}", solution.report);
    assert!((solution.values.get(huge)[0] - 1e12).abs() < 1e-2, "{}", solution.report);
}
