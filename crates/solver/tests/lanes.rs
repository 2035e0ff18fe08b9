//! Residuals evaluated in lanes give the same results as the same residuals evaluated one by one.

use depthcal_solver::{
    Batch, EvaluationError, Factor, Graph, Key, LANES, Lane, LaneBatch, Lanes, Loss, Options, Over, Scalar, Values,
    VariableId, check_jacobians, minimize,
};
use nalgebra::{SVector, Vector1, Vector2};

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

struct Curves {
    groups: Vec<(Key<Vector1<f64>>, Vec<Observed>)>,
    shared: Key<Vector2<f64>>,
    ids: Vec<[VariableId; 2]>,
    loss: Loss,
}

impl LaneBatch<2, 3> for Curves {
    const PATTERN: [&'static [u32]; 2] = [&[1, 2], &[0]];
    type Shared = [f64; 3];

    fn name(&self) -> &str {
        "curves"
    }

    fn group_count(&self) -> usize {
        self.groups.len()
    }

    fn variables(&self, group: usize) -> &[VariableId] {
        &self.ids[group]
    }

    fn residual_count(&self, group: usize) -> usize {
        self.groups[group].1.len()
    }

    fn loss(&self) -> Loss {
        self.loss.clone()
    }

    fn share(&self, group: usize, values: &Values) -> Result<[f64; 3], EvaluationError> {
        let p = values.get(self.shared);
        Ok([values.get(self.groups[group].0)[0], p[0], p[1]])
    }

    #[inline(always)]
    fn residuals(&self, group: usize, shared: &[f64; 3], block: usize, residuals: &mut [Lane; 2]) {
        self.linearize(group, shared, block, residuals, &mut [[0.0; LANES]; 3]);
    }

    #[inline(always)]
    fn linearize(
        &self,
        group: usize,
        &[c, a, b]: &[f64; 3],
        block: usize,
        residuals: &mut [Lane; 2],
        jacobian: &mut [Lane; 3],
    ) {
        for l in 0..LANES {
            // Lanes beyond the last residual must be ignored.
            let beyond = Observed { x: 3.0, y: 5.0, z: f64::NAN };
            let o = *self.groups[group].1.get(block * LANES + l).unwrap_or(&beyond);
            let e = (b * o.x).exp();
            residuals[0][l] = a * e - o.y;
            residuals[1][l] = c * o.x - o.z;
            jacobian[0][l] = e;
            jacobian[1][l] = a * o.x * e;
            jacobian[2][l] = o.x;
        }
    }
}

struct Problem {
    lanes: Graph,
    factors: Graph,
    values: Values,
    slopes: Vec<Key<Vector1<f64>>>,
    shared: Key<Vector2<f64>>,
}

fn problem(loss: &Loss) -> Problem {
    let mut values = Values::new();
    let shared = values.insert(Vector2::new(1.0, 0.2));
    let mut batch = Batch::new("curves").with_loss(loss.clone());
    let mut groups = Vec::new();
    let mut ids = Vec::new();
    for group in 0..60_usize {
        let slope = values.insert(Vector1::new(0.0));
        // The number of residuals modulo the number of lanes takes all values.
        let observed: Vec<Observed> = (0..5 + group % 19)
            .map(|i| {
                let x = 0.1 * (i + 1) as f64;
                let wrong = if i % 7 == 3 { 3.0 } else { 0.01 * ((i * 7 + group) % 5) as f64 };
                Observed { x, y: 1.5 * (0.5 * x).exp() + wrong, z: 0.1 * group as f64 * x - wrong }
            })
            .collect();
        observed.iter().for_each(|o| batch.push(*o, (slope, shared)));
        ids.push([slope.id(), shared.id()]);
        groups.push((slope, observed));
    }
    let slopes = groups.iter().map(|g| g.0).collect();
    let mut lanes = Graph::new();
    lanes.add_batch(Lanes::new(Curves { groups, shared, ids, loss: loss.clone() }));
    let mut factors = Graph::new();
    factors.add_batch(batch);
    Problem { lanes, factors, values, slopes, shared }
}

#[test]
fn lanes_and_factors_have_the_same_minimum() {
    for loss in [Loss::Trivial, Loss::Huber { delta: 0.1 }] {
        for fixed in 0..3 {
            let Problem { mut lanes, mut factors, values, slopes, shared } = problem(&loss);
            for graph in [&mut lanes, &mut factors] {
                match fixed {
                    0 => {}
                    1 => graph.fix_partly(shared, &[true, false]),
                    _ => slopes.iter().take(20).for_each(|s| graph.fix(*s)),
                }
            }
            let options = Options::default();
            let a = minimize(&lanes, values.clone(), &options).unwrap();
            let b = minimize(&factors, values, &options).unwrap();
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
fn lanes_can_be_evaluated_one_by_one() {
    let Problem { lanes, factors, values, .. } = problem(&Loss::Trivial);
    let error = check_jacobians(&lanes, &values, 1e-5).unwrap();
    // Central differences are good to about 1e-9.
    assert!(error.iter().all(|e| e.error < 1e-7), "{error:?}");
    let residuals = |graph: &Graph| {
        let ids: Vec<_> = graph.batches().map(|(id, b)| (id, b.row_count(7))).collect();
        ids.into_iter().map(|(id, _)| graph.residuals(id, &values).unwrap()).collect::<Vec<_>>()
    };
    for (a, b) in residuals(&lanes).concat().iter().zip(residuals(&factors).concat()) {
        assert!((a - b).abs() < 1e-12);
    }
    assert!(lanes.batches().all(|(_, b)| b.lanes().is_some()));
}

#[test]
fn lanes_give_the_same_bits_for_any_number_of_threads() {
    let Problem { lanes, values, .. } = problem(&Loss::Huber { delta: 0.1 });
    let solve = |threads| {
        let solution = minimize(&lanes, values.clone(), &Options { threads, ..Options::default() }).unwrap();
        (solution.report.cost.to_bits(), format!("{:?}", solution.values))
    };
    let one = solve(1);
    for threads in [2, 5] {
        assert_eq!(solve(threads), one);
    }
}

#[test]
fn a_pattern_that_does_not_fit_is_refused() {
    struct Odd(Curves);
    impl LaneBatch<2, 3> for Odd {
        const PATTERN: [&'static [u32]; 2] = [&[1, 3], &[0]];
        type Shared = [f64; 3];
        fn name(&self) -> &str {
            "odd"
        }
        fn group_count(&self) -> usize {
            1
        }
        fn variables(&self, group: usize) -> &[VariableId] {
            &self.0.ids[group]
        }
        fn residual_count(&self, group: usize) -> usize {
            self.0.residual_count(group)
        }
        fn share(&self, group: usize, values: &Values) -> Result<[f64; 3], EvaluationError> {
            self.0.share(group, values)
        }
        fn residuals(&self, group: usize, shared: &[f64; 3], block: usize, residuals: &mut [Lane; 2]) {
            self.0.residuals(group, shared, block, residuals);
        }
        fn linearize(&self, g: usize, shared: &[f64; 3], block: usize, r: &mut [Lane; 2], j: &mut [Lane; 3]) {
            self.0.linearize(g, shared, block, r, j);
        }
    }
    let mut values = Values::new();
    let shared = values.insert(Vector2::new(1.0, 0.2));
    let slope = values.insert(Vector1::new(0.0));
    let groups = vec![(slope, vec![Observed { x: 1.0, y: 1.0, z: 1.0 }])];
    let ids = vec![[slope.id(), shared.id()]];
    let mut graph = Graph::new();
    graph.add_batch(Lanes::new(Odd(Curves { groups, shared, ids, loss: Loss::Trivial })));
    let message = minimize(&graph, values, &Options::default()).unwrap_err().to_string();
    assert!(message.contains("odd") && message.contains("3 columns"), "{message}");
}
