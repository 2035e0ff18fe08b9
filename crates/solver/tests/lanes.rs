//! Groups of many factors, which are evaluated together, give the same results as the same factors in groups of one.

use depthcal_solver::{
    Batch, Factor, Graph, Key, Loss, Noise, Options, Over, Scalar, Values, check_jacobians, minimize,
};
use nalgebra::{Matrix2, SVector, Vector1, Vector2};

/// A growing curve a exp(b x) = y and a line c x = z with the slope of its group.
#[derive(Clone, Copy)]
struct Observed {
    x: f64,
    y: f64,
    z: f64,
}

impl Factor<2> for Observed {
    type Variables = (Vector1<f64>, Vector2<f64>);

    fn residual<T: Scalar>(&self, (c, p): Over<Self::Variables, T>) -> SVector<T, 2> {
        SVector::<T, 2>::new(p[0] * (p[1] * self.x).exp() - self.y, c[0] * self.x - self.z)
    }
}

struct Problem {
    /// Each group's factors one after the other.
    together: Graph,
    /// These factors, no two of a group in a row.
    single: Graph,
    values: Values,
    slopes: Vec<Key<Vector1<f64>>>,
    shared: Key<Vector2<f64>>,
}

/// Groups of 2 to 149 factors: less than one block, whole blocks, and more.
fn problem(loss: &Loss, noise: &Noise<2>) -> Problem {
    let mut values = Values::new();
    let shared = values.insert(Vector2::new(1.0, 0.2));
    let slopes: Vec<_> = (0..50).map(|_| values.insert(Vector1::new(0.0))).collect();
    let groups: Vec<Vec<Observed>> = (0..50_usize)
        .map(|group| {
            let observed = (0..2 + 3 * group).map(|i| {
                let x = 0.02 * i as f64;
                let wave = 0.05 * (7.0 * x + group as f64).sin();
                Observed { x, y: 1.5 * (0.4 * x).exp() + wave, z: (0.1 * group as f64) * x - wave }
            });
            observed.collect()
        })
        .collect();
    let batch = || Batch::new("curves").with_loss(loss.clone()).with_noise(noise.clone());
    let (mut together, mut single) = (batch(), batch());
    for (slope, observed) in slopes.iter().zip(&groups) {
        observed.iter().for_each(|o| together.push(*o, (*slope, shared)));
    }
    // The groups take turns; when the last is left alone, each of its factors is a batch of its own.
    let mut ungrouped = Vec::new();
    for i in 0..149 {
        let with: Vec<usize> = (0..50).filter(|g| i < groups[*g].len()).collect();
        match with[..] {
            [group] => ungrouped.push((groups[group][i], slopes[group])),
            _ => with.iter().for_each(|group| single.push(groups[*group][i], (slopes[*group], shared))),
        }
    }
    let mut graphs = [Graph::new(), Graph::new()];
    graphs[0].add_batch(together);
    graphs[1].add_batch(single);
    for (observed, slope) in ungrouped {
        let mut batch = batch();
        batch.push(observed, (slope, shared));
        graphs[1].add_batch(batch);
    }
    let [together, single] = graphs;
    Problem { together, single, values, slopes, shared }
}

fn noises() -> [Noise<2>; 3] {
    let correlated = Matrix2::new(0.04, 0.01, 0.01, 0.09);
    [Noise::unit(), Noise::diagonal([0.1, 0.3]).unwrap(), Noise::covariance(correlated).unwrap()]
}

#[test]
fn the_minimum_is_that_of_single_factors() {
    for (loss, noise) in [Loss::Trivial, Loss::Huber { delta: 0.1 }]
        .into_iter()
        .flat_map(|l| noises().into_iter().map(move |noise| (l.clone(), noise)))
    {
        for fixed in 0..3 {
            let Problem { mut together, mut single, values, slopes, shared } = problem(&loss, &noise);
            for graph in [&mut together, &mut single] {
                match fixed {
                    0 => {}
                    1 => graph.fix_partly(shared, &[true, false]),
                    _ => slopes.iter().take(20).for_each(|s| graph.fix(*s)),
                }
            }
            let a = minimize(&together, values.clone(), &Options::default()).unwrap();
            let b = minimize(&single, values, &Options::default()).unwrap();
            assert!(a.report.converged && b.report.converged);
            // Sums in another order differ by rounding, and so do the iterates.
            for (a, b) in a.report.trace.iter().zip(&b.report.trace) {
                assert!((a.cost - b.cost).abs() < 1e-9 * b.cost, "{} {}", a.cost, b.cost);
            }
            assert!((a.values.get(shared) - b.values.get(shared)).norm() < 1e-6);
            for s in &slopes {
                assert!((a.values.get(*s) - b.values.get(*s)).norm() < 1e-6);
            }
        }
    }
}

#[test]
fn their_jacobian_is_that_of_differences() {
    let Problem { together, values, .. } = problem(&Loss::Trivial, &noises()[2]);
    let error = check_jacobians(&together, &values, 1e-5).unwrap();
    // Central differences are good to about 1e-9.
    assert!(error.iter().all(|e| e.error < 1e-7), "{error:?}");
}

#[test]
fn they_give_the_same_bits_for_any_number_of_threads() {
    let Problem { together, values, .. } = problem(&Loss::Huber { delta: 0.1 }, &noises()[1]);
    let solve = |threads| {
        let solution = minimize(&together, values.clone(), &Options { threads, ..Options::default() }).unwrap();
        (solution.report.cost.to_bits(), format!("{:?}", solution.values))
    };
    let one = solve(1);
    for threads in [2, 5] {
        assert_eq!(solve(threads), one);
    }
}

/// A variable that some residuals of a group do not depend on is not left out of the others.
#[test]
fn a_column_that_is_zero_for_some_factors_counts_for_the_others() {
    /// The slope matters beyond x = 1 only.
    struct Hinge(f64, f64);
    impl Factor<1> for Hinge {
        type Variables = (Vector2<f64>,);
        fn residual<T: Scalar>(&self, (p,): Over<Self::Variables, T>) -> SVector<T, 1> {
            let level = p[0] - self.1;
            SVector::<T, 1>::new(if self.0 > 1.0 { level + p[1] * (self.0 - 1.0) } else { level })
        }
    }
    let mut values = Values::new();
    let key = values.insert(Vector2::zeros());
    let mut batch = Batch::new("hinge");
    for i in 0..100 {
        let x = 0.02 * f64::from(i);
        batch.push(Hinge(x, 2.0 + 3.0 * (x - 1.0).max(0.0)), (key,));
    }
    let mut graph = Graph::new();
    graph.add_batch(batch);
    let solution = minimize(&graph, values, &Options::default()).unwrap();
    assert!((solution.values.get(key) - Vector2::new(2.0, 3.0)).norm() < 1e-9);
}

/// More components than loops over them are written out for, alone and together.
#[test]
fn a_variable_of_many_components_has_all_its_columns() {
    struct Sum(usize);
    impl Factor<2> for Sum {
        type Variables = (SVector<f64, 15>, Vector1<f64>);
        fn residual<T: Scalar>(&self, (many, one): Over<Self::Variables, T>) -> SVector<T, 2> {
            let mut sum = one[0];
            for i in 0..15 {
                sum += many[i] * many[(i + self.0) % 15] * (1.0 + i as f64);
            }
            SVector::<T, 2>::new(sum, many[self.0 % 15] * 2.0)
        }
    }
    for count in [3, 40] {
        let mut values = Values::new();
        let many = values.insert(SVector::<f64, 15>::from_fn(|i, _| 0.1 * i as f64 - 0.5));
        let one = values.insert(Vector1::new(0.3));
        let mut batch = Batch::new("sums");
        (0..count).for_each(|i| batch.push(Sum(i), (many, one)));
        let mut graph = Graph::new();
        graph.add_batch(batch);
        let error = check_jacobians(&graph, &values, 1e-5).unwrap();
        assert!(error.iter().all(|e| e.error < 1e-7), "{error:?}");
    }
}
