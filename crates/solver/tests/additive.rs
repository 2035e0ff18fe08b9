//! Functions planted in a problem whose runs have variables of their own.

use depthcal_solver::additive::{Covariate, MissingFunction, Observed, missing_functions};
use depthcal_solver::{Batch, BatchId, Factor, Graph, Noise, Options, Over, Scalar, Values, VariableId, minimize};
use nalgebra::{SVector, Vector1, Vector2};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

const RUNS: usize = 24;
const ROWS: usize = 80;
const SIGMA: f64 = 0.2;

/// y = own + a x + b w, where each run has its own offset `own`.
#[derive(Clone, Copy)]
struct Row {
    x: f64,
    w: f64,
    t: f64,
    y: f64,
}

impl Factor<1> for Row {
    type Variables = (Vector1<f64>, Vector2<f64>);
    fn residual<T: Scalar>(&self, (own, slopes): Over<Self::Variables, T>) -> SVector<T, 1> {
        SVector::<T, 1>::new(own[0] + slopes[0] * self.x + slopes[1] * self.w - self.y)
    }
}

struct Problem {
    graph: Graph,
    values: Values,
    runs: Vec<VariableId>,
    batch: BatchId,
    rows: Vec<Row>,
}

/// Runs with offsets of their own, and a function f(x, w, t) that the model lacks, fitted without it.
fn problem(seed: u64, function: impl Fn(f64, f64, f64) -> f64) -> Problem {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut values = Values::new();
    let slopes = values.insert(Vector2::zeros());
    let mut batch = Batch::new("rows").with_noise(Noise::isotropic(SIGMA).unwrap());
    let (mut runs, mut rows): (Vec<VariableId>, _) = (Vec::new(), Vec::new());
    for run in 0..RUNS {
        let offset = values.insert(Vector1::zeros());
        runs.push(offset.into());
        let common: f64 = rng.random_range(-3.0..3.0);
        for _ in 0..ROWS {
            let (x, w) = (rng.random_range(-2.0..2.0), rng.random_range(-1.0..1.0));
            let t = run as f64 + rng.random_range(0.0..1.0);
            let noise: f64 = StandardNormal.sample(&mut rng);
            let y = common + 0.7 * x - 0.4 * w + function(x, w, t) + SIGMA * noise;
            let row = Row { x, w, t, y };
            batch.push(row, (offset, slopes));
            rows.push(row);
        }
    }
    let mut graph = Graph::new();
    let batch = graph.add_batch(batch);
    let values = minimize(&graph, values, &Options::default()).unwrap().values;
    Problem { graph, values, runs, batch, rows }
}

fn searched(Problem { graph, values, runs, batch, rows }: &Problem) -> Vec<MissingFunction> {
    let time = Covariate { is_sequential: true, ..Covariate::new("t") };
    let covariates = [Covariate::new("x"), Covariate::new("w"), time];
    let observed = |row: usize| {
        let Row { x, w, t, .. } = rows[row];
        Observed { covariates: vec![x, w, t], slope: 1.0 / SIGMA }
    };
    missing_functions(graph, values, runs, *batch, &covariates, observed).unwrap()
}

/// Largest difference between a function that was found and the planted one, without a constant and a slope, which the model has.
fn deviation(found: impl Fn(f64) -> f64, planted: impl Fn(f64) -> f64, end: f64) -> f64 {
    let points: Vec<[f64; 2]> =
        (-20..=20).map(|i| end * f64::from(i) / 20.0).map(|x| [x, found(x) - planted(x)]).collect();
    let mean = points.iter().map(|[_, d]| d).sum::<f64>() / points.len() as f64;
    let [xd, xx] = points.iter().fold([0.0; 2], |[xd, xx], [x, d]| [xd + x * d, xx + x * x]);
    points.iter().map(|[x, d]| (d - mean - xd / xx * x).abs()).fold(0.0, f64::max)
}

/// Twenty problems in which nothing is missing: at the level of the test, over all functions, one at most may show something.
#[test]
fn nothing_is_found_where_nothing_is_missing() {
    let false_finds: Vec<u64> = (0..20).filter(|seed| !searched(&problem(*seed, |_, _, _| 0.0)).is_empty()).collect();
    assert!(false_finds.len() <= 1, "something in {false_finds:?}");
}

#[test]
fn two_functions_are_found_and_their_shapes_are_right() {
    let (of_x, of_w) = (|x: f64| 0.4 * (2.5 * x).sin(), |w: f64| 0.5 * (4.0 * w).tanh());
    let functions = searched(&problem(3, |x, w, _| of_x(x) + of_w(w)));
    let names: Vec<&[String]> = functions.iter().map(|function| &function.covariates[..]).collect();
    assert_eq!(functions.len(), 2, "{names:?}");
    let named = |name: &str| functions.iter().find(|function| function.covariates == [name]).unwrap();
    // 1920 rows of 0.2 over some twelve functions each: about 0.02 each, twice that at the ends.
    let error_x = deviation(|x| named("x").value(&[x, 0.0, 0.0]), of_x, 2.0);
    let error_w = deviation(|w| named("w").value(&[0.0, w, 0.0]), of_w, 1.0);
    assert!(error_x < 0.08 && error_w < 0.08, "{error_x} {error_w}");
    assert!(functions.iter().all(|function| function.share > 0.1));
}

/// No function of one covariate describes it.
#[test]
fn a_function_of_two_covariates_is_found() {
    let functions = searched(&problem(4, |x, w, _| 0.5 * (2.0 * x).cos() * (3.0 * w).sin()));
    assert!(functions.iter().any(|function| function.covariates == ["x", "w"]), "{functions:?}");
    let whole = |x: f64, w: f64| functions.iter().map(|function| function.value(&[x, w, 0.0])).sum::<f64>();
    // A product has no part that offsets and slopes take up but its mean slope along w.
    let differences = [[0.0, 0.5], [1.0, -0.5], [-1.5, 0.5], [1.5, -0.5]]
        .map(|[x, w]: [f64; 2]| whole(x, w) - whole(x, -w) - (2.0 * x).cos() * (3.0 * w).sin());
    let slopes = differences.map(f64::abs);
    assert!(slopes.iter().all(|d| *d < 0.35), "{differences:?}");
}

/// Each is searched while the other two are still in the residuals.
#[test]
fn three_functions_are_found_together() {
    let product = |x: f64, w: f64| 0.6 * (2.0 * x).cos() * (3.0 * w).sin();
    let functions = searched(&problem(6, |x, w, _| 0.4 * (2.5 * x).sin() + 0.5 * (4.0 * w).tanh() + product(x, w)));
    let mut names: Vec<&[String]> = functions.iter().map(|function| &function.covariates[..]).collect();
    names.sort_by_key(|names| names.len());
    assert_eq!(names.last(), Some(&&["x".to_owned(), "w".to_owned()][..]), "{names:?}");
    let whole = |x: f64, w: f64| functions.iter().map(|function| function.value(&[x, w, 0.0])).sum::<f64>();
    let of_x = deviation(|x| whole(x, 0.0), |x| 0.4 * (2.5 * x).sin(), 2.0);
    let of_w = deviation(|w| whole(0.5, w), |w| 0.5 * (4.0 * w).tanh() + product(0.5, w), 1.0);
    // 1920 rows of 0.2 over some 60 functions: about 0.035 each, more at the ends.
    assert!(of_x < 0.15 && of_w < 0.15, "{of_x} {of_w}");
}

/// Offsets of whole runs are variables of the runs: a function of time between the runs is taken up by them.
#[test]
fn what_runs_take_up_is_not_found() {
    let functions = searched(&problem(5, |_, _, t| 0.3 * (t / 4.0).floor()));
    assert!(functions.is_empty(), "{functions:?}");
}
