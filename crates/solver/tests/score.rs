//! Score tests against solving again with the candidate free, and against their theoretical distributions.

use depthcal_solver::score::{Candidate, Linearization};
use depthcal_solver::{Batch, Factor, Graph, Key, Options, Over, Scalar, Values, VariableId, minimize};
use nalgebra::{DMatrix, DVector, SVector, Vector1, Vector2};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// y = own + a x + b x³ + bend x² + extra · z, where each run has its own offset `own`.
struct Row {
    x: f64,
    z: [f64; 2],
    y: f64,
}

impl Factor<1> for Row {
    type Variables = (Vector1<f64>, Vector2<f64>, Vector1<f64>, Vector2<f64>);
    fn residual<T: Scalar>(&self, (own, line, bend, extra): Over<Self::Variables, T>) -> SVector<T, 1> {
        let line = line[0] * self.x + line[1] * (self.x * self.x * self.x);
        let bend = bend[0] * (self.x * self.x);
        let extra = extra[0] * self.z[0] + extra[1] * self.z[1];
        SVector::<T, 1>::new(own[0] + line + bend + extra - self.y)
    }
}

struct Problem {
    graph: Graph,
    values: Values,
    runs: Vec<Key<Vector1<f64>>>,
    line: Key<Vector2<f64>>,
    bend: Key<Vector1<f64>>,
    extra: Key<Vector2<f64>>,
}

const RUNS: usize = 24;

/// Runs of 20 rows. `bend` is the size of the effect missing from the model, `shake` the standard deviation of an error
/// proportional to x² that the rows of a run have in common.
fn problem(seed: u64, bend: f64, shake: f64, without: Option<usize>) -> Problem {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = move || -> f64 { StandardNormal.sample(&mut rng) };
    let mut values = Values::new();
    let line = values.insert(Vector2::zeros());
    let bend_key = values.insert(Vector1::zeros());
    let extra = values.insert(Vector2::zeros());
    let runs: Vec<_> = (0..RUNS).map(|_| values.insert(Vector1::zeros())).collect();
    let mut graph = Graph::new();
    let mut batch = Batch::new("rows");
    for (run, key) in runs.iter().enumerate() {
        let (noise, common) = (normal(), shake * normal());
        for _ in 0..20 {
            let (x, z) = (normal(), [normal(), normal()]);
            let y = noise + 0.7 * x - 0.2 * x * x * x + (bend + common) * x * x + normal();
            if without != Some(run) {
                batch.push(Row { x, z, y }, (*key, line, bend_key, extra));
            }
        }
    }
    graph.add_batch(batch);
    graph.fix(bend_key);
    graph.fix(extra);
    if let Some(run) = without {
        graph.fix(runs[run]);
    }
    Problem { graph, values, runs, line, bend: bend_key, extra }
}

fn solve(p: &mut Problem) -> f64 {
    let solution = minimize(&p.graph, p.values.clone(), &Options::default()).unwrap();
    p.values = solution.values;
    p.graph.cost(&p.values).unwrap()
}

fn linearize(p: &Problem) -> Linearization {
    let runs: Vec<VariableId> = p.runs.iter().map(|k| k.id()).collect();
    let candidates = [Candidate::new("bend", p.bend), Candidate::new("extra", p.extra)];
    Linearization::new(&p.graph, &p.values, &runs, &candidates).unwrap()
}

/// The problem is linear: the expected change is the estimate, S is twice the decrease of the cost, and the covariance is that of
/// the estimate.
#[test]
fn a_linear_problem_is_predicted_exactly() {
    let mut p = problem(3, 0.1, 0.0, None);
    let before = solve(&mut p);
    let score = linearize(&p).score(0);
    p.graph.unfix(p.bend);
    let after = solve(&mut p);
    let estimate = p.values.get(p.bend)[0];
    assert!((score.change[0] - estimate).abs() < 1e-9 * estimate.abs(), "{} against {estimate}", score.change[0]);
    assert!((score.statistic - 2.0 * (before - after)).abs() < 1e-7 * score.statistic);
    let covariance = depthcal_solver::Covariance::compute(&p.graph, &p.values, &Default::default()).unwrap();
    assert!((score.covariance[(0, 0)] / covariance.marginal(p.bend)[(0, 0)] - 1.0).abs() < 1e-8);
}

/// The gain on a held-out run is the difference of its costs at two solutions without the run, with and without the candidate,
/// where the run's own offset is fitted to the run.
#[test]
fn held_out_gain_is_what_solving_again_without_a_run_gives() {
    let mut p = problem(4, 0.1, 0.0, None);
    solve(&mut p);
    let gains = linearize(&p).held_out_gain(&[0]);
    for run in [0, 7, 23] {
        let mut costs = [0.0; 2];
        for (release, cost) in [false, true].into_iter().zip(&mut costs) {
            let mut others = problem(4, 0.1, 0.0, Some(run));
            if release {
                others.graph.unfix(others.bend);
            }
            solve(&mut others);
            // The held-out run with the shared variables fixed at that solution.
            let mut held_out = problem(4, 0.1, 0.0, None);
            held_out.values.set(held_out.line, *others.values.get(others.line));
            held_out.values.set(held_out.bend, *others.values.get(others.bend));
            held_out.graph.fix(held_out.line);
            for (k, key) in held_out.runs.clone().into_iter().enumerate() {
                if k != run {
                    held_out.graph.fix(key);
                }
            }
            solve(&mut held_out);
            let residuals =
                held_out.graph.residuals(held_out.graph.batches().next().unwrap().0, &held_out.values).unwrap();
            *cost = 0.5 * residuals[20 * run..20 * run + 20].iter().map(|r| r * r).sum::<f64>();
        }
        let expected = costs[0] - costs[1];
        assert!((gains[run] - expected).abs() < 1e-7 * expected.abs().max(1.0), "{} against {expected}", gains[run]);
    }
}

/// Largest distance between the distribution of p-values and the uniform one (Kolmogorov–Smirnov).
fn distance_from_uniform(mut p_values: Vec<f64>) -> f64 {
    p_values.sort_by(f64::total_cmp);
    let n = p_values.len() as f64;
    let steps = p_values.iter().enumerate().map(|(i, p)| (p - i as f64 / n).abs().max(((i + 1) as f64 / n - p).abs()));
    steps.fold(0.0, f64::max)
}

/// 300 seeds: the Kolmogorov–Smirnov distance exceeds 0.094 once in a hundred.
#[test]
fn p_values_are_uniform_where_nothing_is_missing() {
    for candidate in [0, 1] {
        let (mut plain, mut clustered) = (Vec::new(), Vec::new());
        for seed in 0..300 {
            let mut p = problem(1000 + seed, 0.0, 0.0, None);
            solve(&mut p);
            let score = linearize(&p).score(candidate);
            plain.push(score.p_value);
            clustered.push(score.clustered_p_value);
        }
        assert!(distance_from_uniform(plain) < 0.094);
        assert!(distance_from_uniform(clustered) < 0.094);
    }
}

/// With an error common to a whole run, the plain test falsely detects an effect in most problems; the clustered test does so
/// no more often than its level.
#[test]
fn shared_errors_of_a_cluster_deceive_the_plain_test_only() {
    let (mut plain, mut clustered) = (0, 0);
    for seed in 0..200 {
        let mut p = problem(5000 + seed, 0.0, 0.3, None);
        solve(&mut p);
        let score = linearize(&p).score(0);
        plain += usize::from(score.p_value < 0.05);
        clustered += usize::from(score.clustered_p_value < 0.05);
    }
    assert!(plain > 60, "the plain test rejected {plain} of 200");
    // 5 % of 200 with three binomial standard deviations (3.1).
    assert!(clustered < 20, "the clustered test rejected {clustered} of 200");
}

/// An effect of the size that should be detected with probability 80 % is: 300 seeds, three standard deviations (2.3 %).
#[test]
fn detectable_sizes_are_detected_as_often_as_promised() {
    let mut significant = 0;
    for seed in 0..300 {
        let mut clean = problem(9000 + seed, 0.0, 0.0, None);
        solve(&mut clean);
        let size = linearize(&clean).detectable_factors(0, &[DVector::from_element(1, 1.0)], 0.01, 0.8)[0];
        let mut p = problem(9000 + seed, size, 0.0, None);
        solve(&mut p);
        significant += usize::from(linearize(&p).score(0).p_value < 0.01);
    }
    assert!((222..=258).contains(&significant), "{significant} of 300 against 240 expected");
}

#[test]
fn mimicry_tells_twins_from_strangers() {
    let mut p = problem(11, 0.1, 0.0, None);
    solve(&mut p);
    let linearization = linearize(&p);
    let one = DVector::from_element(1, 1.0);
    assert!((linearization.mimicry(0, &one, 0) - 1.0).abs() < 1e-6);
    assert!(linearization.mimicry(0, &one, 1) < 0.2, "independent regressors");
}

/// A candidate with many parameters and a smoothness prior does no harm on held-out runs, and a prior of the wrong size is
/// refused.
#[test]
fn smoothness_priors_tame_free_candidates() {
    let mut p = problem(12, 0.0, 0.0, None);
    solve(&mut p);
    let runs: Vec<VariableId> = p.runs.iter().map(|k| k.id()).collect();
    let gain = |smoothness: Option<DMatrix<f64>>| {
        let candidate = Candidate { smoothness, ..Candidate::new("extra", p.extra) };
        Linearization::new(&p.graph, &p.values, &runs, &[candidate]).map(|l| l.held_out_gain(&[0]).iter().sum::<f64>())
    };
    assert!(gain(Some(DMatrix::identity(2, 2))).unwrap() > gain(None).unwrap());
    assert!(gain(Some(DMatrix::identity(3, 3))).unwrap_err().to_string().contains("3×3"));
}

#[test]
fn only_fixed_variables_are_candidates() {
    let mut p = problem(13, 0.0, 0.0, None);
    p.graph.unfix(p.bend);
    let runs: Vec<VariableId> = p.runs.iter().map(|k| k.id()).collect();
    let error = Linearization::new(&p.graph, &p.values, &runs, &[Candidate::new("bend", p.bend)]).unwrap_err();
    assert!(error.to_string().contains("only fixed components"), "{error}");
}

/// The factor by which the runs' scores scatter more than their information says, over some problems.
fn scatter_of_bend(bend: f64, shake: f64) -> f64 {
    let ratio = |seed: u64| {
        let mut p = problem(seed, bend, shake, None);
        solve(&mut p);
        let joint = linearize(&p).efficient_scores(&[0, 1]);
        joint.scatter[(0, 0)] / joint.information[(0, 0)]
    };
    (0..20).map(|seed| ratio(300 + seed)).sum::<f64>() / 20.0
}

#[test]
fn runs_scatter_by_their_noise_and_not_by_the_effect_itself() {
    // Twenty problems of 24 runs: the mean of their factors has a standard deviation of √(2/23/20) = 0.066. An effect of this
    // size raises the scatter about the mean score to some tens, because x² says more in some runs than in others.
    for bend in [0.0, 3.0] {
        let factor = scatter_of_bend(bend, 0.0);
        assert!((factor - 1.0).abs() < 0.25, "{bend}: {factor}");
    }
    let shaken = scatter_of_bend(3.0, 0.5);
    assert!(shaken > 3.0, "errors that rows of a run have in common are not seen: {shaken}");
}
