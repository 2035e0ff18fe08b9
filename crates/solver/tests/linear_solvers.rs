//! Every linear solver gives the solution of the dense normal equations, on random problems.

use crate::common::{self, LINEAR_SOLVERS, normal, rng};
use depthcal_solver::{
    Covariance, CovarianceOptions, EvaluationError, FactorBatch, Graph, Key, Options, Values, VariableId, minimize,
};
use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use rand::RngExt;
use rand::seq::SliceRandom;

/// r = A x + b over some vectors.
struct Linear {
    groups: Vec<Group>,
}

/// Ids, keys, A, b.
type Group = (Vec<VariableId>, Vec<Key<DVector<f64>>>, DMatrix<f64>, DVector<f64>);

impl FactorBatch for Linear {
    fn name(&self) -> &str {
        "linear"
    }

    fn group_count(&self) -> usize {
        self.groups.len()
    }

    fn variables(&self, group: usize) -> &[VariableId] {
        &self.groups[group].0
    }

    fn row_count(&self, group: usize) -> usize {
        self.groups[group].3.len()
    }

    fn evaluate(
        &self,
        group: usize,
        values: &Values,
        residuals: &mut [f64],
        jacobian: Option<&mut [f64]>,
    ) -> Result<(), EvaluationError> {
        let (_, keys, a, b) = &self.groups[group];
        let x = DVector::from_iterator(a.ncols(), keys.iter().flat_map(|k| values.get(*k).iter().copied()));
        residuals.copy_from_slice((a * x + b).as_slice());
        if let Some(jacobian) = jacobian {
            jacobian.copy_from_slice(a.transpose().as_slice());
        }
        Ok(())
    }
}

struct Problem {
    graph: Graph,
    values: Values,
    keys: Vec<Key<DVector<f64>>>,
    /// A mutually unconnected group.
    independent: Vec<Key<DVector<f64>>>,
    /// The solution and the covariance over all components, zero where fixed.
    solution: DVector<f64>,
    covariance: DMatrix<f64>,
}

/// A random sparse linear least-squares problem of full rank with some components fixed, and its dense solution.
fn problem(seed: u64) -> Problem {
    let mut rng = rng(seed);
    let count = rng.random_range(2..14);
    let mut values = Values::new();
    let keys: Vec<_> = (0..count)
        .map(|_| {
            let dim = rng.random_range(1..6);
            values.insert(DVector::from_fn(dim, |_, _| normal(&mut rng)))
        })
        .collect();
    let mut offset = vec![0];
    for key in &keys {
        offset.push(offset[offset.len() - 1] + values.get(*key).len());
    }
    let n = offset[count];
    let mut groups = Vec::new();
    let mut connected = vec![vec![false; count]; count];
    let mut add = |members: Vec<usize>, rows: usize, groups: &mut Vec<_>| {
        let keys: Vec<_> = members.iter().map(|m| keys[*m]).collect();
        let columns = keys.iter().map(|k| values.get(*k).len()).sum();
        for a in &members {
            for b in &members {
                connected[*a][*b] = true;
            }
        }
        let a = DMatrix::from_fn(rows, columns, |_, _| normal(&mut rng));
        let b = DVector::from_fn(rows, |_, _| normal(&mut rng));
        groups.push((keys.iter().map(|k| k.id()).collect(), keys, a, b));
    };
    // Rows that depend on one variable alone make the problem determined.
    for v in 0..count {
        add(vec![v], offset[v + 1] - offset[v] + 1, &mut groups);
    }
    let mut shape = common::rng(seed ^ 0x5eed);
    for _ in 0..shape.random_range(1..20) {
        let mut members: Vec<usize> = (0..count).collect();
        members.shuffle(&mut shape);
        members.truncate(shape.random_range(1..=4));
        add(members, [1, 2, 5, 30][shape.random_range(0..4)], &mut groups);
    }
    let mut graph = Graph::new();
    let mut free = vec![true; n];
    if count > 3 {
        graph.fix(keys[1]);
        free[offset[1]..offset[2]].fill(false);
        let dim = offset[3] - offset[2];
        let mask: Vec<bool> = (0..dim).map(|i| i % 2 == 1).collect();
        graph.fix_partly(keys[2], &mask);
        (0..dim).for_each(|i| free[offset[2] + i] = !mask[i]);
    }
    let mut independent: Vec<usize> = Vec::new();
    for v in 0..count {
        if independent.iter().all(|i| !connected[*i][v]) {
            independent.push(v);
        }
    }
    let (solution, covariance) = dense_solution(&groups, &keys, &values, &offset, &free);
    graph.add_batch(Linear { groups });
    let independent = independent.into_iter().map(|i| keys[i]).collect();
    Problem { graph, values, keys, independent, solution, covariance }
}

/// The solution and the covariance over all components, by the inverse of the dense normal matrix; `offset` has the first
/// component of each key, and the number of all.
fn dense_solution(
    groups: &[Group],
    keys: &[Key<DVector<f64>>],
    values: &Values,
    offset: &[usize],
    free: &[bool],
) -> (DVector<f64>, DMatrix<f64>) {
    let n = free.len();
    let rows: usize = groups.iter().map(|g| g.3.len()).sum();
    let mut j = DMatrix::zeros(rows, n);
    let mut r = DVector::zeros(rows);
    let mut row = 0;
    for (_, members, a, b) in groups {
        let mut column = 0;
        for key in members {
            let v = keys.iter().position(|k| k == key).unwrap();
            let d = offset[v + 1] - offset[v];
            j.view_mut((row, offset[v]), (a.nrows(), d)).copy_from(&a.columns(column, d));
            column += d;
        }
        r.rows_mut(row, b.len()).copy_from(b);
        row += b.len();
    }
    let x0 = DVector::from_iterator(n, keys.iter().flat_map(|k| values.get(*k).iter().copied()));
    r += &j * &x0;
    let picked: Vec<usize> = (0..n).filter(|i| free[*i]).collect();
    let jf = j.select_columns(&picked);
    let inverse = (jf.transpose() * &jf).try_inverse().unwrap();
    let delta = -&inverse * jf.tr_mul(&r);
    let mut solution = x0;
    let mut covariance = DMatrix::zeros(n, n);
    for (a, i) in picked.iter().enumerate() {
        solution[*i] += delta[a];
        for (b, k) in picked.iter().enumerate() {
            covariance[(*i, *k)] = inverse[(a, b)];
        }
    }
    (solution, covariance)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, failure_persistence: None, rng_seed: RngSeed::Fixed(1), ..ProptestConfig::default() })]

    #[test]
    fn all_linear_solvers_agree_with_the_dense_solution(seed in 0_u64..1_000_000, eliminate: bool) {
        let Problem { mut graph, values, keys, independent, solution, covariance } = problem(seed);
        if eliminate {
            graph.eliminate(independent);
        }
        for linear_solver in LINEAR_SOLVERS {
            let options = Options { linear_solver, cost_tolerance: 1e-15, parameter_tolerance: 1e-12, ..Options::default() };
            let solved = minimize(&graph, values.clone(), &options).unwrap();
            let x = DVector::from_iterator(
                solution.len(),
                keys.iter().flat_map(|k| solved.values.get(*k).iter().copied().collect::<Vec<_>>()),
            );
            // Random Gaussian matrices of this size have condition numbers up to some thousands.
            prop_assert!((&x - &solution).amax() < 1e-7 * (1.0 + solution.amax()), "{linear_solver:?} {}", solved.report);
        }
        let ids: Vec<_> = keys.iter().map(|k| k.id()).collect();
        let joint = Covariance::compute(&graph, &values, &CovarianceOptions::default()).unwrap().joint(&ids);
        prop_assert!((&joint - &covariance).amax() < 1e-7 * (1.0 + covariance.amax()));
        let selected = Covariance::selected(&graph, &values, &ids, &CovarianceOptions::default()).unwrap().joint(&ids);
        prop_assert!((&selected - &covariance).amax() < 1e-7 * (1.0 + covariance.amax()));
    }
}
