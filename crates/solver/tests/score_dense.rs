//! Scores and what is derived from them against dense linear algebra: every row of the Jacobian written down, projections by
//! singular values, nothing eliminated block by block.

use depthcal_solver::score::{Candidate, Linearization};
use depthcal_solver::{Batch, Factor, Graph, Key, Loss, Options, Over, Scalar, Values, VariableId, minimize};
use nalgebra::{DMatrix, DVector, Matrix2, RowDVector, SVector, Vector1, Vector2};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

const RUNS: usize = 9;
const ROWS: usize = 12;
/// Beyond this residual the loss is linear: some rows of every run are.
const DELTA: f64 = 1.2;

/// own₀ + own₁ t + line₀ x + line₁ x³ + bend x² + extra · z − y.
#[derive(Clone)]
struct Row {
    t: f64,
    x: f64,
    z: [f64; 2],
    y: f64,
}

impl Factor<1> for Row {
    type Variables = (Vector2<f64>, Vector2<f64>, Vector1<f64>, Vector2<f64>);
    fn residual<T: Scalar>(&self, (own, line, bend, extra): Over<Self::Variables, T>) -> SVector<T, 1> {
        let of_run = own[0] + own[1] * self.t;
        let line = line[0] * self.x + line[1] * (self.x * self.x * self.x);
        let extra = extra[0] * self.z[0] + extra[1] * self.z[1];
        SVector::<T, 1>::new(of_run + line + bend[0] * (self.x * self.x) + extra - self.y)
    }
}

/// A measurement of the line from elsewhere, without any run.
struct Known(f64);

impl Factor<1> for Known {
    type Variables = (Vector2<f64>,);
    fn residual<T: Scalar>(&self, (line,): Over<Self::Variables, T>) -> SVector<T, 1> {
        SVector::<T, 1>::new(line[0] * 3.0 - self.0)
    }
}

struct Problem {
    graph: Graph,
    values: Values,
    runs: Vec<Key<Vector2<f64>>>,
    line: Key<Vector2<f64>>,
    bend: Key<Vector1<f64>>,
    extra: Key<Vector2<f64>>,
    rows: Vec<Vec<Row>>,
}

/// The second number of a run has no influence on the first run, t = 0. `extra_mask` says which components of `extra` are fixed.
fn problem(extra_mask: [bool; 2]) -> Problem {
    let mut rng = ChaCha8Rng::seed_from_u64(77);
    let mut normal = move || -> f64 { StandardNormal.sample(&mut rng) };
    let mut values = Values::new();
    let line = values.insert(Vector2::zeros());
    let bend = values.insert(Vector1::zeros());
    let extra = values.insert(Vector2::zeros());
    let runs: Vec<_> = (0..RUNS).map(|_| values.insert(Vector2::zeros())).collect();
    let (mut graph, mut rows) = (Graph::new(), Vec::new());
    let mut batch = Batch::new("rows").with_loss(Loss::Huber { delta: DELTA });
    for (run, key) in runs.iter().enumerate() {
        let line_of_run = [normal(), normal()];
        let of_run: Vec<Row> = (0..ROWS)
            .map(|_| {
                let t = if run == 0 { 0.0 } else { normal() };
                let (x, z) = (normal(), [normal(), normal()]);
                // Regressors that resemble each other.
                let z = [z[0] + 0.5 * x * x, z[1] + 0.4 * x * x];
                let y =
                    line_of_run[0] + line_of_run[1] * t + 0.7 * x + 0.3 * x * x + 0.2 * z[0] - 0.4 * z[1] + normal();
                Row { t, x, z, y }
            })
            .collect();
        of_run.iter().for_each(|row| batch.push(row.clone(), (*key, line, bend, extra)));
        rows.push(of_run);
    }
    let mut known = Batch::new("known");
    known.push(Known(2.4), (line,));
    graph.add_batch(batch);
    graph.add_batch(known);
    graph.fix(bend);
    graph.fix_partly(extra, &extra_mask);
    // Short of the minimum, so that the gradient of every column counts.
    let options = Options { max_iterations: 2, ..Options::default() };
    values = minimize(&graph, values, &options).unwrap().values;
    Problem { graph, values, runs, line, bend, extra, rows }
}

/// The weighted rows of a run: residuals, and columns of its own two numbers, of `line` and `extra`, and of `bend`.
struct Dense {
    r: DVector<f64>,
    own: DMatrix<f64>,
    line: DMatrix<f64>,
    bend: DMatrix<f64>,
    extra: DMatrix<f64>,
}

fn dense(p: &Problem) -> Vec<Dense> {
    let of_run = |(run, rows): (usize, &Vec<Row>)| {
        let (of_run, line) = (p.values.get(p.runs[run]), p.values.get(p.line));
        let (bend, extra) = (p.values.get(p.bend)[0], p.values.get(p.extra));
        let residual = |row: &Row| {
            of_run[0]
                + of_run[1] * row.t
                + line[0] * row.x
                + line[1] * row.x.powi(3)
                + bend * row.x.powi(2)
                + extra[0] * row.z[0]
                + extra[1] * row.z[1]
                - row.y
        };
        let weight = |row: &Row| (DELTA / residual(row).abs()).min(1.0).sqrt();
        let matrix = |columns: usize, entry: &dyn Fn(&Row, usize) -> f64| {
            DMatrix::from_fn(rows.len(), columns, |i, k| weight(&rows[i]) * entry(&rows[i], k))
        };
        Dense {
            r: DVector::from_fn(rows.len(), |i, _| weight(&rows[i]) * residual(&rows[i])),
            own: matrix(2, &|row, k| [1.0, row.t][k]),
            line: matrix(2, &|row, k| row.x.powi(1 + 2 * k as i32)),
            bend: matrix(1, &|row, _| row.x.powi(2)),
            extra: matrix(2, &|row, k| row.z[k]),
        }
    };
    p.rows.iter().enumerate().map(of_run).collect()
}

/// The part of each column that a linear combination of `basis` does not explain.
fn without(basis: &DMatrix<f64>, columns: &DMatrix<f64>) -> DMatrix<f64> {
    let svd = basis.clone().svd(true, true);
    columns - basis * svd.solve(columns, 1e-9).unwrap()
}

/// Residuals, shared columns (`line`, then `extra₀` where that is free) and columns of candidates after each run's own numbers,
/// run by run; the last entry is the row that belongs to no run.
fn reduced(p: &Problem, extra_is_free: bool) -> Vec<(DVector<f64>, DMatrix<f64>, DMatrix<f64>)> {
    let mut parts: Vec<_> = dense(p)
        .into_iter()
        .map(|d| {
            let (shared, candidates) = if extra_is_free {
                (hstack(&[&d.line, &d.extra.columns(0, 1).into_owned()]), d.extra.columns(1, 1).into_owned())
            } else {
                (d.line, d.extra)
            };
            let r = without(&d.own, &DMatrix::from_column_slice(ROWS, 1, d.r.as_slice()));
            (r.column(0).into_owned(), without(&d.own, &shared), without(&d.own, &hstack(&[&d.bend, &candidates])))
        })
        .collect();
    let (shared, candidates) = (parts[0].1.ncols(), parts[0].2.ncols());
    let mut known = DMatrix::zeros(1, shared);
    known[(0, 0)] = 3.0;
    let r = 3.0 * p.values.get(p.line)[0] - 2.4;
    parts.push((DVector::from_element(1, r), known, DMatrix::zeros(1, candidates)));
    parts
}

fn hstack(parts: &[&DMatrix<f64>]) -> DMatrix<f64> {
    let columns: Vec<_> = parts.iter().flat_map(|m| m.column_iter().map(|c| c.into_owned())).collect();
    DMatrix::from_columns(&columns)
}

fn vstack<'a>(parts: impl Iterator<Item = &'a DMatrix<f64>>) -> DMatrix<f64> {
    let rows: Vec<RowDVector<f64>> =
        parts.flat_map(|m| m.row_iter().map(|row| row.into_owned()).collect::<Vec<_>>()).collect();
    DMatrix::from_rows(&rows)
}

fn linearize(p: &Problem, smoothness: Option<DMatrix<f64>>) -> Linearization {
    let runs: Vec<VariableId> = p.runs.iter().map(|k| k.id()).collect();
    let extra = Candidate { smoothness, ..Candidate::new("extra", p.extra) };
    Linearization::new(&p.graph, &p.values, &runs, &[Candidate::new("bend", p.bend), extra]).unwrap()
}

#[track_caller]
fn close(value: f64, expected: f64) {
    assert!((value - expected).abs() < 1e-8 * expected.abs().max(1e-3), "{value} against {expected}");
}

#[track_caller]
fn all_close(value: &DMatrix<f64>, expected: &DMatrix<f64>) {
    assert_eq!(value.shape(), expected.shape());
    assert!((value - expected).amax() < 1e-8 * expected.amax(), "{value} against {expected}");
}

/// Everything over all rows: residuals, shared columns, columns of candidates.
fn whole(parts: &[(DVector<f64>, DMatrix<f64>, DMatrix<f64>)]) -> (DVector<f64>, DMatrix<f64>, DMatrix<f64>) {
    let r: Vec<f64> = parts.iter().flat_map(|p| p.0.iter().copied()).collect();
    (DVector::from_vec(r), vstack(parts.iter().map(|p| &p.1)), vstack(parts.iter().map(|p| &p.2)))
}

#[test]
fn clusters_are_described_as_they_are() {
    let p = problem([false, true]);
    let lin = linearize(&p, None);
    assert_eq!((lin.cluster_count(), lin.candidate_count(), lin.shared_count()), (RUNS, 2, 3));
    assert_eq!(([0, 1].map(|i| lin.name(i)), [0, 1].map(|i| lin.parameter_count(i))), (["bend", "extra"], [1, 1]));
    for (run, d) in dense(&p).iter().enumerate() {
        assert_eq!(lin.cluster_rows(run), ROWS);
        close(lin.cluster_cost(run), 0.5 * d.r.norm_squared());
    }
    let linear = |d: &Dense| d.r.iter().any(|r| r.abs() > DELTA);
    assert!(dense(&p).iter().filter(|d| linear(d)).count() > RUNS / 2, "few rows are beyond the loss' limit");
}

/// Of one free and one fixed component of a variable, with a run whose second number no row determines.
#[test]
fn scores_of_candidates_are_projections() {
    let p = problem([false, true]);
    let lin = linearize(&p, None);
    let parts = reduced(&p, true);
    let (r, shared, candidates) = whole(&parts);
    let projected = without(&shared, &candidates);
    let information = projected.transpose() * &projected;
    let score = -(projected.transpose() * &r);
    let joint = lin.efficient_scores(&[0, 1]);
    all_close(&joint.information, &information);
    (0..2).for_each(|i| close(joint.score[i], score[i]));
    all_close(&joint.response, &-shared.clone().svd(true, true).solve(&candidates, 1e-9).unwrap());
    // In the other order, and alone.
    let turned = lin.efficient_scores(&[1, 0]);
    close(turned.score[0], score[1]);
    close(turned.information[(0, 1)], information[(0, 1)]);
    close(lin.efficient_scores(&[1]).information[(0, 0)], information[(1, 1)]);
    let step = information.clone().try_inverse().unwrap() * &score;
    let change = lin.joint_change(&[0, 1]);
    (0..2).for_each(|i| close(change[i], step[i]));

    // Parts of the runs, each about what the candidate's own estimate explains of them.
    let mut scatter = Matrix2::zeros();
    let mut plain = [0.0; 2];
    for (run, (r, ..)) in parts[..RUNS].iter().enumerate() {
        let rows = projected.rows(run * ROWS, ROWS);
        let left = Vector2::from_fn(|i, _| {
            let column = rows.column(i);
            plain[i] += column.dot(r).powi(2);
            -column.dot(r) - column.norm_squared() * score[i] / information[(i, i)]
        });
        scatter += left * left.transpose();
    }
    all_close(&joint.scatter, &DMatrix::from_fn(2, 2, |i, k| scatter[(i, k)]));

    for i in [0, 1] {
        let (u, v) = (score[i], information[(i, i)]);
        let test = lin.score(i);
        assert_eq!(test.rank, 1);
        close(test.statistic, u * u / v);
        close(test.p_value, depthcal_statistics::chi_squared_tail(u * u / v, 1));
        close(test.change[0], u / v);
        close(test.covariance[(0, 0)], 1.0 / v);
        close(test.clustered_covariance[(0, 0)], plain[i] / (v * v));
        // Hotelling's statistic without a mean taken off: F with 1 and n − 1 degrees of freedom.
        let (t, n) = (u * u / plain[i], RUNS as f64);
        close(test.clustered_p_value, depthcal_statistics::f_tail((n - 1.0) * t / (n - t), 1, RUNS - 1));
    }
}

/// Scores of a candidate given another, and how well one can take the place of the other.
#[test]
fn candidates_are_told_apart_by_what_is_left_of_them() {
    let p = problem([false, true]);
    let lin = linearize(&p, None);
    let (r, shared, candidates) = whole(&reduced(&p, true));
    let alone = without(&shared, &candidates);
    let v = alone.column(0).norm_squared();
    let basis = hstack(&[&shared, &candidates.columns(1, 1).into_owned()]);
    let given = without(&basis, &candidates.columns(0, 1).into_owned());
    let remaining = given.norm_squared();
    let size = DVector::from_element(1, -1.7);
    close(lin.visible_information(0)[(0, 0)], v);
    close(lin.noncentrality(0, &size, &[]), 1.7 * 1.7 * v);
    close(lin.noncentrality(0, &size, &[1]), 1.7 * 1.7 * remaining);
    close(lin.mimicry(0, &size, 1), (1.0 - remaining / v).sqrt());
    assert!((0.2..0.9).contains(&lin.mimicry(0, &size, 1)), "neither twins nor strangers");
    close(lin.mimicry(0, &DVector::zeros(1), 1), 1.0);
    let adjusted = lin.score_adjusted(0, &[1]);
    let u = -given.column(0).dot(&r);
    close(adjusted.statistic, u * u / remaining);
    close(adjusted.change[0], u / remaining);
    // A normal variable of this mean is beyond 2.5758 of either sign in 80 of 100 cases: 2.5758 + 0.8416 standard deviations.
    let factor = lin.detectable_factors(0, &[size], 0.01, 0.8)[0];
    assert!((factor * 1.7 * v.sqrt() - (2.575_829 + 0.841_621)).abs() < 1e-4, "{}", factor * 1.7 * v.sqrt());
    // A candidate given itself has nothing left: no rank, no significance.
    let nothing = lin.score_adjusted(0, &[0]);
    assert_eq!((nothing.rank, nothing.p_value, nothing.clustered_p_value), (0, 1.0, 1.0));
}

/// Another cluster like one that is there: its rows twice, with numbers of its own.
#[test]
fn a_further_cluster_adds_its_information() {
    let p = problem([false, true]);
    let lin = linearize(&p, None);
    let mut parts = reduced(&p, true);
    parts.push(parts[3].clone());
    let (_, shared, candidates) = whole(&parts);
    let more = lin.with_cluster(&lin, 3);
    let expected = without(&shared, &candidates).column(0).norm_squared();
    close(more.visible_information(0)[(0, 0)], expected);
    close(more.score(0).covariance[(0, 0)], 1.0 / expected);
    assert_eq!(more.cluster_count(), RUNS);
}

#[test]
#[should_panic(expected = "different problems")]
fn clusters_of_different_problems_do_not_mix() {
    let p = problem([false, true]);
    let runs: Vec<VariableId> = p.runs.iter().map(|k| k.id()).collect();
    let fewer = Linearization::new(&p.graph, &p.values, &runs, &[Candidate::new("bend", p.bend)]).unwrap();
    let _ = linearize(&p, None).with_cluster(&fewer, 0);
}

/// The scatter of four runs says nothing of two parameters, that of five little.
#[test]
fn few_clusters_have_no_scatter() {
    let p = problem([true, true]);
    let score = |runs: usize| {
        let runs: Vec<VariableId> = p.runs[..runs].iter().map(|k| k.id()).collect();
        Linearization::new(&p.graph, &p.values, &runs, &[Candidate::new("extra", p.extra)]).unwrap().score(0)
    };
    assert!(score(4).clustered_p_value.is_nan());
    assert!((0.0..1.0).contains(&score(5).clustered_p_value));
    assert_eq!(score(5).rank, 2);
}

/// For each strength of the prior the held-out costs, by taking each run out of the sums; then the strength that gains most.
#[test]
fn held_out_gains_and_priors_are_those_of_taking_runs_out() {
    let p = problem([true, true]);
    let parts = reduced(&p, false);
    let prior = DMatrix::from_row_slice(2, 2, &[2.0, -1.0, -1.0, 1.0]);
    let lin = linearize(&p, Some(prior.clone()));
    // Columns: line, bend where it takes part, extra.
    let columns = |(_, shared, candidates): &(DVector<f64>, DMatrix<f64>, DMatrix<f64>), bend: bool, extra: bool| {
        let mut all = vec![shared.clone()];
        all.extend(bend.then(|| candidates.columns(0, 1).into_owned()));
        all.extend(extra.then(|| candidates.columns(1, 2).into_owned()));
        hstack(&all.iter().collect::<Vec<_>>())
    };
    let costs = |bend: bool, extra: bool, strength: f64| -> (Vec<f64>, DVector<f64>) {
        let normal: Vec<_> = parts
            .iter()
            .map(|part| {
                let j = columns(part, bend, extra);
                (j.transpose() * &j, j.transpose() * &part.0)
            })
            .collect();
        let n = normal[0].1.len();
        let mut h = normal.iter().fold(DMatrix::zeros(n, n), |sum, (h, _)| sum + h);
        let g = normal.iter().fold(DVector::zeros(n), |sum, (_, g)| sum + g);
        if extra {
            let trace = h[(n - 1, n - 1)] + h[(n - 2, n - 2)];
            let mut block = h.view_mut((n - 2, n - 2), (2, 2));
            block += &prior * (strength * trace / prior.trace());
        }
        let held_out = |(of_part, slope): &(DMatrix<f64>, DVector<f64>)| {
            let step = -(&h - of_part).lu().solve(&(&g - slope)).unwrap();
            slope.dot(&step) + 0.5 * step.dot(&(of_part * &step))
        };
        (normal[..RUNS].iter().map(held_out).collect(), -h.lu().solve(&g).unwrap())
    };
    let base = costs(false, false, 0.0).0;
    // Without a prior.
    let gains = lin.held_out_gain(&[0]);
    costs(true, false, 0.0).0.iter().zip(&base).zip(&gains).for_each(|((c, b), gain)| close(*gain, b - c));
    // With one.
    for (candidates, bend) in [(&[1][..], false), (&[0, 1], true)] {
        let strengths = [1e-4, 1e-3, 1e-2, 1e-1, 1.0, 10.0];
        let tried: Vec<_> = strengths.iter().map(|s| costs(bend, true, *s)).collect();
        let sum = |costs: &[f64]| costs.iter().sum::<f64>();
        let best = tried.iter().min_by(|a, b| sum(&a.0).total_cmp(&sum(&b.0))).unwrap();
        let gains = lin.held_out_gain(candidates);
        best.0.iter().zip(&base).zip(&gains).for_each(|((c, b), gain)| close(*gain, b - c));
        let change = lin.joint_change(candidates);
        let expected = best.1.rows(2, best.1.len() - 2);
        (0..expected.len()).for_each(|i| close(change[i], expected[i]));
        // The strengths differ: the strongest prior is worse than the weakest.
        let order: Vec<f64> = tried.iter().map(|t| sum(&t.0)).collect();
        assert!(order.iter().all(|c| *c >= sum(&best.0)) && order[5] > order[0] + 1e-3 * order[0].abs());
    }
}
