//! Laws of variables, losses, noise models and derivatives.

use crate::common::{Between, Distance, Projection, normal, normal3, rng};
use depthcal_solver::{
    AutoDiffVariable, Batch, EvaluationError, FactorBatch, Graph, Key, Loss, Noise, NoiseError, Values, Variable,
    VariableId, check_jacobians,
};
use nalgebra::{
    DVector, Isometry3, Matrix2, SMatrix, SVector, Translation3, Unit, UnitQuaternion, Vector1, Vector2, Vector3,
};
use num_dual::{Derivative, DualSVec64};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

fn vector3(size: f64) -> impl Strategy<Value = Vector3<f64>> {
    [-size..size, -size..size, -size..size].prop_map(Vector3::from)
}

fn rotation() -> impl Strategy<Value = UnitQuaternion<f64>> {
    prop_oneof![Just(UnitQuaternion::identity()), vector3(3.0).prop_map(UnitQuaternion::from_scaled_axis)]
}

fn pose() -> impl Strategy<Value = Isometry3<f64>> {
    (rotation(), vector3(5.0)).prop_map(|(r, t)| Isometry3::from_parts(Translation3::from(t), r))
}

fn direction() -> impl Strategy<Value = Unit<Vector3<f64>>> {
    prop_oneof![Just(Vector3::z()), Just(-Vector3::z()), vector3(1.0).prop_filter("a direction", |v| v.norm() > 1e-3)]
        .prop_map(Unit::new_normalize)
}

/// local(retract(δ)) = δ; retract(0) = x; retract(local(y)) = y, measured by `distance`.
fn round_trip<V: Variable>(x: &V, y: &V, delta: &[f64], distance: impl Fn(&V, &V) -> f64) {
    let n = x.dim();
    let mut back = vec![f64::NAN; n];
    x.local(&x.retract(&delta[..n]), &mut back);
    for (a, b) in delta.iter().zip(&back) {
        assert!((a - b).abs() < 1e-12, "{delta:?} {back:?}");
    }
    assert!(distance(&x.retract(&vec![0.0; n]), x) < 1e-15);
    x.local(x, &mut back);
    assert!(back.iter().all(|d| d.abs() < 1e-15));
    x.local(y, &mut back);
    assert!(distance(&x.retract(&back), y) < 1e-7, "{x:?} {y:?} {back:?}");
    // The closed form of the local Jacobian against the differences of the default.
    struct Differences<'a, V>(&'a V);
    impl<V: Variable> Differences<'_, V> {
        fn column(&self, y: &V, j: usize, step: f64) -> Vec<f64> {
            let mut delta = vec![0.0; y.dim()];
            delta[j] = step;
            let mut local = vec![0.0; y.dim()];
            self.0.local(&y.retract(&delta), &mut local);
            local
        }
    }
    let mut jacobian = vec![f64::NAN; n * n];
    let moved = x.retract(&delta[..n]);
    x.local_jacobian(&moved, &mut jacobian);
    for j in 0..n {
        let (above, below) = (Differences(x).column(&moved, j, 1e-5), Differences(x).column(&moved, j, -1e-5));
        for i in 0..n {
            let difference = (above[i] - below[i]) / 2e-5;
            assert!((jacobian[i * n + j] - difference).abs() < 1e-7, "{i} {j} {} {difference}", jacobian[i * n + j]);
        }
    }
}

/// Compares the derivative at δ = 0 of a variable retracted over dual numbers with differences of its retraction, both in
/// some coordinates.
fn derivatives_agree<V: AutoDiffVariable, const K: usize>(
    x: &V,
    coordinates: impl Fn(&V) -> SVector<f64, K>,
    seen: impl Fn(V::Over<DualSVec64<4>>) -> SVector<DualSVec64<4>, K>,
) {
    for j in 0..V::DIM {
        let dual = seen(x.retract_over(|i| {
            if i == j {
                let mut eps = SVector::zeros();
                eps[0] = 1.0;
                DualSVec64::new(0.0, Derivative::some(eps))
            } else {
                DualSVec64::from(0.0)
            }
        }));
        let mut delta = vec![0.0; V::DIM];
        delta[j] = 1e-5;
        let above = coordinates(&x.retract(&delta));
        delta[j] = -1e-5;
        let below = coordinates(&x.retract(&delta));
        for k in 0..K {
            let derivative = dual[k].eps.unwrap_generic(nalgebra::Const::<4>, nalgebra::Const::<1>)[0];
            assert!((dual[k].re - coordinates(x)[k]).abs() < 1e-14);
            let difference = (above[k] - below[k]) / 2e-5;
            assert!((derivative - difference).abs() < 1e-9 * (1.0 + coordinates(x).amax()), "{j} {k}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, rng_seed: RngSeed::Fixed(1), ..ProptestConfig::default() })]

    #[test]
    fn retraction_and_local_are_inverse(
        (r1, r2) in (rotation(), rotation()),
        (p1, p2) in (pose(), pose()),
        (d1, d2) in (direction(), direction()),
        a in vector3(10.0),
        b in vector3(10.0),
        // Below the radius of injectivity of the rotations, π.
        delta in prop::array::uniform6(-1.5..1.5_f64),
    ) {
        round_trip(&a, &b, &delta, |a, b| (a - b).norm());
        let dynamic = |v: &Vector3<f64>| DVector::from_column_slice(v.as_slice());
        round_trip(&dynamic(&a), &dynamic(&b), &delta, |a, b| (a - b).norm());
        round_trip(&r1, &r2, &delta, |a, b| a.angle_to(b));
        round_trip(&p1, &p2, &delta, |a, b| (a.to_homogeneous() - b.to_homogeneous()).amax());
        round_trip(&d1, &d2, &delta, |a, b| (a.into_inner() - b.into_inner()).norm());
    }

    #[test]
    fn variables_over_dual_numbers_have_the_derivatives_of_their_retractions(
        r in rotation(), p in pose(), d in direction(), x in vector3(2.0),
    ) {
        let constant = |v: Vector3<f64>| v.map(DualSVec64::<4>::from);
        derivatives_agree(&r, |r| r * x, |l| l.rotate(&constant(x)));
        derivatives_agree(&r, |r| r.inverse() * x, |l| l.inverse().rotate(&constant(x)));
        derivatives_agree(&p, |p| (p * nalgebra::Point3::from(x)).coords, |l| l.transform(&constant(x)));
        derivatives_agree(&p, |p| (p.inverse() * nalgebra::Point3::from(x)).coords, |l| l.inverse().transform(&constant(x)));
        derivatives_agree(&d, |d| d.into_inner(), |l| l);
        derivatives_agree(&x, |v| *v, |l| l);
    }

    #[test]
    fn the_logarithm_undoes_the_exponential_and_has_its_derivative(w in vector3(1.7), small in 0.0..1e-7_f64) {
        for w in [w, w * small, Vector3::zeros()] {
            let r = UnitQuaternion::from_scaled_axis(w);
            let log = depthcal_solver::Rotation::<f64>::constant(&r).log();
            prop_assert!((log - w).norm() < 1e-12);
            // The derivative at δ = 0 of Log(R Exp(δ)), differences of nalgebra's logarithm as the oracle.
            derivatives_agree(&r, |r| r.scaled_axis(), |l| l.log());
        }
    }

    #[test]
    fn losses_have_their_derivatives_and_start_like_least_squares(
        s in 1e-3..50.0_f64, c in 0.3..3.0_f64, alpha in -5.0..1.9_f64, weight in 0.1..4.0_f64,
    ) {
        let losses = [
            Loss::Trivial,
            Loss::Huber { delta: c },
            Loss::Cauchy { scale: c },
            Loss::Tukey { scale: c },
            Loss::GemanMcClure { scale: c },
            Loss::Barron { alpha, scale: c },
            Loss::Barron { alpha: 2.0, scale: c },
            Loss::Barron { alpha: 0.0, scale: c },
            Loss::Barron { alpha: 1e-12, scale: c },
            Loss::Barron { alpha: f64::NEG_INFINITY, scale: c },
            Loss::Cauchy { scale: c }.scaled(weight),
        ];
        for loss in losses {
            let h = 1e-5 * s;
            let [_, first, second] = loss.evaluate(s);
            let (above, below) = (loss.evaluate(s + h), loss.evaluate(s - h));
            // Away from the points where the pieces of Huber's and Tukey's losses meet.
            if (s - c * c).abs() > 2.0 * h {
                prop_assert!(((above[0] - below[0]) / (2.0 * h) - first).abs() < 1e-7, "{loss:?}");
                prop_assert!(((above[1] - below[1]) / (2.0 * h) - second).abs() < 1e-6 * (1.0 + 1.0 / (c * c * c)), "{loss:?}");
            }
            prop_assert!(first >= 0.0 && second <= 0.0, "{loss:?}");
            let scale = if matches!(loss, Loss::Scaled { .. }) { weight } else { 1.0 };
            // ρ(s) = s + O(s²) relative to the scale.
            let tiny = 1e-9;
            prop_assert!((loss.evaluate(tiny)[0] / (scale * tiny) - 1.0).abs() < 1e-6, "{loss:?}");
            prop_assert_eq!(loss.evaluate(0.0)[0], 0.0);
        }
        // Special cases of Barron's loss, whose c² is half or twice that of the classical forms.
        let close = |a: [f64; 3], b: [f64; 3]| (0..3).all(|i| (a[i] - b[i]).abs() < 1e-12 * (1.0 + b[i].abs()));
        let cauchy = Loss::Cauchy { scale: c * 2.0_f64.sqrt() }.evaluate(s);
        let barron = Loss::Barron { alpha: 0.0, scale: c }.evaluate(s);
        prop_assert!(close(barron, cauchy));
        let geman = Loss::GemanMcClure { scale: 2.0 * c }.evaluate(s);
        let barron = Loss::Barron { alpha: -2.0, scale: c }.evaluate(s);
        prop_assert!(close(barron, geman));
    }

    #[test]
    fn derivatives_of_typed_factors_agree_with_differences(seed in 0_u64..1000, at_identity: bool) {
        let mut rng = rng(seed);
        let mut values = Values::new();
        let mut pose = || {
            if at_identity {
                return Isometry3::identity();
            }
            let w = 0.8 * normal3(&mut rng);
            Isometry3::from_parts(Translation3::from(normal3(&mut rng)), UnitQuaternion::from_scaled_axis(w))
        };
        let (a, b) = (values.insert(pose()), values.insert(pose()));
        let measured = pose();
        let point = values.insert(Vector3::new(0.3, -0.2, 6.0) + 0.3 * normal3(&mut rng));
        let other = values.insert(normal3(&mut rng));
        let camera = values.insert(Vector2::new(2.0, -0.1));
        values.set(a, Isometry3::from_parts(values.get(a).translation, UnitQuaternion::from_scaled_axis(0.2 * normal3(&mut rng))));
        if at_identity {
            values.set(a, Isometry3::identity());
        }
        let mut graph = Graph::new();
        let m = SMatrix::<f64, 2, 2>::from_fn(|_, _| normal(&mut rng));
        let noise = Noise::covariance(m * m.transpose() + Matrix2::identity()).unwrap();
        let mut projections = Batch::new("projection").with_noise(noise);
        projections.push(Projection { observed: Vector2::new(0.1, 0.2) }, (a, camera, point));
        graph.add_batch(projections);
        // Away from half a turn, where the logarithm is discontinuous.
        let relative = measured.inverse() * values.get(a).inverse() * values.get(b);
        if relative.rotation.angle() < 2.8 {
            graph.add(Between(measured), (a, b));
        }
        graph.add(Distance(1.0), (point, other));
        for error in check_jacobians(&graph, &values, 1e-5).unwrap() {
            prop_assert!(error.error < 1e-7, "{error:?}");
        }
    }
}

#[test]
fn noise_models_whiten_and_refuse_nonsense() {
    let covariance = Matrix2::new(4.0, 1.0, 1.0, 2.0);
    let noise = Noise::covariance(covariance).unwrap();
    let a = SMatrix::<f64, 2, 2>::from_columns(&[noise.whiten(Vector2::x()), noise.whiten(Vector2::y())]);
    assert!((a.transpose() * a * covariance - Matrix2::identity()).amax() < 1e-14);
    assert_eq!(Noise::isotropic(0.5).unwrap().whiten(Vector1::new(1.0))[0], 2.0);
    assert_eq!(Noise::diagonal([0.5, f64::INFINITY]).unwrap().whiten(Vector2::new(1.0, 7.0)), Vector2::new(2.0, 0.0));
    assert_eq!(Noise::<1>::isotropic(0.0), Err(NoiseError::Sigma { component: 0, sigma: 0.0 }));
    assert_eq!(Noise::covariance(Matrix2::new(1.0, 2.0, 2.0, 1.0)), Err(NoiseError::NotPositiveDefinite));
    assert_eq!(Noise::covariance(Matrix2::new(1.0, 0.1, 0.2, 1.0)), Err(NoiseError::NotPositiveDefinite));
    assert!(Noise::square_root_information(Matrix2::new(f64::NAN, 0.0, 0.0, 1.0)).is_err());
}

#[test]
fn a_jacobian_by_hand_is_used_and_a_wrong_one_is_found() {
    struct ByHand(f64, Key<Vector2<f64>>, [VariableId; 1]);
    impl FactorBatch for ByHand {
        fn name(&self) -> &str {
            "by hand"
        }
        fn group_count(&self) -> usize {
            1
        }
        fn variables(&self, _: usize) -> &[VariableId] {
            &self.2
        }
        fn row_count(&self, _: usize) -> usize {
            1
        }
        fn evaluate(
            &self,
            _: usize,
            values: &Values,
            residuals: &mut [f64],
            jacobian: Option<&mut [f64]>,
        ) -> Result<(), EvaluationError> {
            let x = values.get(self.1);
            residuals[0] = x.x * x.y;
            if let Some(jacobian) = jacobian {
                jacobian.copy_from_slice(&[x.y, x.x + self.0]);
            }
            Ok(())
        }
    }
    let mut values = Values::new();
    let x = values.insert(Vector2::new(2.0, 3.0));
    for (wrong, expected) in [(0.0, 0.0), (0.5, 0.5 / 3.0)] {
        let mut graph = Graph::new();
        let batch = graph.add_batch(ByHand(wrong, x, [x.id()]));
        let error = check_jacobians(&graph, &values, 1e-5).unwrap().remove(0);
        assert_eq!(error.batch, batch);
        assert!((error.error - expected).abs() < 1e-9, "{error:?}");
    }
}

#[test]
fn factors_with_the_same_keys_form_a_group() {
    let mut values = Values::new();
    let (a, b) = (values.insert(Vector3::zeros()), values.insert(Vector3::x()));
    let mut batch = Batch::new("distances");
    for (i, keys) in [(a, b), (a, b), (b, a), (a, b)].into_iter().enumerate() {
        batch.push(Distance(i as f64), keys);
    }
    assert_eq!((0..batch.group_count()).map(|g| batch.row_count(g)).collect::<Vec<_>>(), [2, 1, 1]);
    assert_eq!(batch.variables(1), [b.id(), a.id()]);
    let mut graph = Graph::new();
    let id = graph.add_batch(batch);
    assert_eq!(graph.residuals(id, &values).unwrap(), [1.0, 0.0, -1.0, -2.0]);
    assert_eq!(graph.batch_cost(id, &values).unwrap(), 3.0);
}

#[test]
fn values_are_shared_until_written_to() {
    let mut values = Values::new();
    let x = values.insert(Vector2::new(1.0, 2.0));
    let r = values.insert(UnitQuaternion::identity());
    let copy = values.clone();
    values.set(x, Vector2::zeros());
    values.retract(r.id(), &[0.1, 0.0, 0.0]);
    assert_eq!(copy.get(x), &Vector2::new(1.0, 2.0));
    assert_eq!(copy.get(r).angle(), 0.0);
    assert!((values.get(r).angle() - 0.1).abs() < 1e-15);
    let late = values.insert(Vector2::x());
    assert_eq!(copy.try_get(late), None);
    assert_eq!((values.len(), copy.len(), values.dim(r.id()), values.dim(x.id())), (3, 2, 3, 2));
    assert_eq!(values.key::<Vector2<f64>>(late.id()), Some(late));
    assert_eq!(values.key::<Vector3<f64>>(late.id()), None);
}
