//! The scores of all terms of the library: thousands of columns against rows that exist.

use std::collections::BTreeSet;
use std::ops::Range;

use depthcal_formula::FormulaCovariate as C;
use depthcal_model::chain::POSE;
use depthcal_model::{Of, On};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rayon::prelude::*;

use super::library::{Density, Function, factors, functions};
use super::observations::{FrameRows, Observations};
use super::screened::{MOST_GROUPS, Part, Screened, group_of};
use super::term::{Product, Term, family};

/// The covariates of the library.
const COVARIATES: [C; 12] =
    [C::X, C::Y, C::R, C::U, C::V, C::Z, C::Rho, C::Range, C::Incidence, C::Amplitude, C::Time, C::Temperature];
/// Those that others are multiplied with.
const FACTORS: [C; 7] = [C::X, C::Y, C::R, C::Incidence, C::Amplitude, C::Time, C::Temperature];

/// The functions whose products are screened together: all functions of other covariates, times one factor, in one place and
/// form.
struct Job<'a> {
    of: Of,
    on: On,
    factor: Option<Function>,
    columns: &'a Columns,
    /// Those of the columns' functions that take part.
    takes_part: Vec<bool>,
}

/// All terms of the library with their scores.
pub(super) fn screen(observations: &Observations) -> Vec<Screened> {
    let Some(of_shared) = observations.shared_hessian().cholesky() else { return Vec::new() };
    let groups = Groups::of(observations);
    let covariates = observations.with_quantities(&COVARIATES);
    let all_factors = observations.with_quantities(&FACTORS);
    Of::ALL
        .into_iter()
        .flat_map(|of| {
            let spans: Vec<_> = covariates.iter().filter_map(|c| Some((*c, observations.span(*c, of)?))).collect();
            let mut screened: Vec<Screened> = Vec::new();
            for (c, span) in &spans {
                let functions = functions(*c, *span, Density::Fine);
                screened.extend(screen_functions(observations, of, functions, &groups, &of_shared));
            }
            let of_all = spans.iter().flat_map(|(c, span)| functions(*c, *span, Density::Coarse)).collect();
            let multiplied = Columns::of(observations, of, of_all);
            let mut jobs = Vec::new();
            for on in On::ALL {
                for (c, span) in spans.iter().filter(|(c, _)| all_factors.contains(c)) {
                    // Two factors in either order are one product.
                    let place = |c: &C| all_factors.iter().position(|f| f == c);
                    let takes_part = |f: &Function| {
                        let is_another = family(f.covariate) != family(*c);
                        let is_first = f.kind.is_searched() || place(&f.covariate).is_none_or(|p| Some(p) > place(c));
                        is_another && is_first
                    };
                    let takes_part: Vec<bool> = multiplied.functions.iter().map(takes_part).collect();
                    jobs.extend(factors(*c, *span).into_iter().map(|factor| Job {
                        of,
                        on,
                        factor: Some(factor),
                        takes_part: takes_part.clone(),
                        columns: &multiplied,
                    }));
                }
            }
            screened.par_extend(jobs.par_iter().flat_map_iter(|job| job.scores(observations, &groups, &of_shared)));
            screened
        })
        .collect()
}

/// The functions of single covariates of some families, with their scores.
pub(super) fn screen_singles(observations: &Observations, families: &BTreeSet<C>) -> Vec<Screened> {
    let Some(of_shared) = observations.shared_hessian().cholesky() else { return Vec::new() };
    let groups = Groups::of(observations);
    let covariates = observations.with_quantities(&COVARIATES);
    let of_families: Vec<C> = covariates.into_iter().filter(|c| families.contains(&family(*c))).collect();
    let mut screened = Vec::new();
    for of in Of::ALL {
        for covariate in &of_families {
            if let Some(span) = observations.span(*covariate, of) {
                let functions = functions(*covariate, span, Density::Fine);
                screened.extend(screen_functions(observations, of, functions, &groups, &of_shared));
            }
        }
    }
    screened
}

/// Functions of one covariate, alone and in all forms. Those of one covariate at a time: columns of all would be the largest
/// table of a diagnosis.
fn screen_functions(
    observations: &Observations,
    of: Of,
    functions: Vec<Function>,
    groups: &Groups,
    of_shared: &Cholesky<f64, Dyn>,
) -> Vec<Screened> {
    let columns = Columns::of(observations, of, functions);
    let takes_part = vec![true; columns.functions.len()];
    let jobs = On::ALL.map(|on| Job { of, on, factor: None, takes_part: takes_part.clone(), columns: &columns });
    jobs.par_iter().flat_map_iter(|job| job.scores(observations, groups, of_shared)).collect()
}

/// Products of functions of two covariates, all with their scores: any function of one times any of the other, one of them a wave
/// at most.
pub(super) fn screen_products(observations: &Observations, first: C, second: C) -> Vec<Screened> {
    let Some(of_shared) = observations.shared_hessian().cholesky() else { return Vec::new() };
    let groups = Groups::of(observations);
    let mut screened = Vec::new();
    for of in Of::ALL {
        let Some((first_span, second_span)) = observations.span(first, of).zip(observations.span(second, of)) else {
            continue;
        };
        let orders = [(first, first_span, second, second_span), (second, second_span, first, first_span)];
        for (order, (factor, factor_span, function, span)) in orders.into_iter().enumerate() {
            let factors = functions(factor, factor_span, Density::Paired);
            let mut paired = functions(function, span, Density::Paired);
            // The second time round for waves of the first covariate alone: all else are products of the first round.
            paired.retain(|f| order == 0 || f.kind.columns() > 1);
            let takes_part = vec![true; paired.len()];
            let columns = Columns::of(observations, of, paired);
            let jobs: Vec<Job<'_>> = On::ALL
                .into_iter()
                .flat_map(|on| factors.iter().filter(|f| f.kind.columns() == 1).map(move |f| (on, *f)))
                .map(|(on, f)| Job { of, on, factor: Some(f), takes_part: takes_part.clone(), columns: &columns })
                .collect();
            screened.par_extend(jobs.par_iter().flat_map_iter(|job| job.scores(observations, &groups, &of_shared)));
        }
    }
    screened
}

/// Values of functions at the samples of every frame. Products with every factor, place and form share them: they differ by a
/// weight of each sample.
struct Columns {
    functions: Vec<Function>,
    /// The first column of every function, and the number of all columns.
    starts: Vec<usize>,
    frames: Vec<DMatrix<f64>>,
}

impl Columns {
    fn of(observations: &Observations, of: Of, functions: Vec<Function>) -> Self {
        let mut starts = vec![0];
        for function in &functions {
            starts.push(starts[starts.len() - 1] + function.kind.columns());
        }
        let width = starts[functions.len()];
        let frames = observations.frames.par_iter().map(|frame| {
            let mut columns = DMatrix::zeros(frame.samples.len(), width);
            let mut known: Option<(C, Vec<f64>)> = None;
            for (function, start) in functions.iter().zip(&starts) {
                // Functions of a covariate follow each other.
                if known.as_ref().is_none_or(|(covariate, _)| *covariate != function.covariate) {
                    let values = frame.samples.iter().map(|sample| sample.value(function.covariate, of));
                    known = Some((function.covariate, values.collect()));
                }
                let Some((_, values)) = &known else { continue };
                for (row, value) in values.iter().enumerate() {
                    let values = function.values(*value);
                    for (column, value) in values[..function.kind.columns()].iter().enumerate() {
                        columns[(row, start + column)] = if value.is_finite() { *value } else { 0.0 };
                    }
                }
            }
            columns
        });
        let frames = frames.collect();
        Self { functions, starts, frames }
    }
}

impl Job<'_> {
    /// The scores of its products.
    fn scores(&self, observations: &Observations, groups: &Groups, of_shared: &Cholesky<f64, Dyn>) -> Vec<Screened> {
        let frames: Vec<WeightedRows> = observations.frames.iter().map(|frame| frame.weighted(self)).collect();
        let mut screened = Vec::new();
        let mut first = 0;
        while first < self.takes_part.len() {
            let run = self.takes_part[first..].iter().take(CHUNK).take_while(|takes_part| **takes_part).count();
            if run > 0 {
                screened.extend(self.scores_of_run(first..first + run, observations, &frames, groups, of_shared));
            }
            first += run.max(1);
        }
        screened
    }
}

/// Functions whose columns are multiplied together.
const CHUNK: usize = 64;

/// The rows of a frame for products of a factor.
struct WeightedRows {
    /// Change of the residual of each sample where the function is 1.
    weights: Vec<f64>,
    /// The frame's rows, transposed, each sample times its weight.
    matrix: DMatrix<f64>,
}

impl FrameRows {
    fn weighted(&self, job: &Job<'_>) -> WeightedRows {
        let weights: Vec<f64> = self
            .samples
            .iter()
            .map(|sample| {
                let factor = job.factor.map_or(1.0, |f| f.values(sample.value(f.covariate, job.of))[0]);
                let weight = sample.slope(job.of, job.on) * factor;
                if weight.is_finite() { weight } else { 0.0 }
            })
            .collect();
        let mut matrix = self.rows.matrix().transpose();
        for (mut column, weight) in matrix.column_iter_mut().zip(&weights) {
            column *= *weight;
        }
        WeightedRows { weights, matrix }
    }
}

/// Groups of neighbouring frames; a frame each where there are not very many.
struct Groups {
    frames: usize,
    /// Sum of the frames' normal matrices of the shared columns, by group.
    hessians: Vec<DMatrix<f64>>,
}

impl Groups {
    fn of(observations: &Observations) -> Self {
        let (shared, frames) = (observations.shared, observations.frames.len());
        let mut groups = Self { frames, hessians: vec![DMatrix::zeros(shared, shared); frames.min(MOST_GROUPS)] };
        for (f, frame) in observations.frames.iter().enumerate() {
            let group = groups.of_frame(f);
            groups.hessians[group] += frame.rows.hessian();
        }
        groups
    }

    fn count(&self) -> usize {
        self.hessians.len()
    }

    fn of_frame(&self, frame: usize) -> usize {
        group_of(frame, self.frames, self.count())
    }
}

/// Σ w² a b, in as many sums side by side as the processor adds at a time.
fn weighted_dot(weights: &[f64], a: &[f64], b: &[f64]) -> f64 {
    const LANES: usize = 8;
    let (chunks, tail) = weights.as_chunks::<LANES>();
    let ((a_chunks, a_rest), (b_chunks, b_rest)) = (a.as_chunks::<LANES>(), b.as_chunks::<LANES>());
    let mut sums = [0.0; LANES];
    for ((w, a), b) in chunks.iter().zip(a_chunks).zip(b_chunks) {
        for lane in 0..LANES {
            sums[lane] += (w[lane] * a[lane]) * (w[lane] * b[lane]);
        }
    }
    let tail: f64 = tail.iter().zip(a_rest).zip(b_rest).map(|((w, a), b)| (w * a) * (w * b)).sum();
    sums.iter().sum::<f64>() + tail
}

/// Sums over the frames of a group for the columns of some functions.
#[derive(Clone)]
struct OfGroup {
    /// Products with the shared columns.
    cross: DMatrix<f64>,
    /// Squares, and products with the next column.
    squares: Vec<f64>,
    neighbours: Vec<f64>,
    /// Products with the residuals.
    gradient: Vec<f64>,
}

impl OfGroup {
    /// Score and information of the term of a column, or of it and the next one.
    fn part(&self, first: usize, columns: usize) -> Part {
        if columns == 1 {
            return Part {
                gradient: [self.gradient[first], 0.0],
                information: [self.squares[first], 0.0, 0.0],
                columns,
            };
        }
        let second = first + 1;
        Part {
            gradient: [self.gradient[first], self.gradient[second]],
            information: [self.squares[first], self.neighbours[first], self.squares[second]],
            columns,
        }
    }
}

impl Job<'_> {
    /// The scores of functions that follow each other.
    fn scores_of_run(
        &self,
        run: Range<usize>,
        observations: &Observations,
        frames: &[WeightedRows],
        groups: &Groups,
        of_shared: &Cholesky<f64, Dyn>,
    ) -> Vec<Screened> {
        let shared = observations.shared;
        let first_column = self.columns.starts[run.start];
        let width = self.columns.starts[run.end] - first_column;
        let none = OfGroup {
            cross: DMatrix::zeros(shared, width),
            squares: vec![0.0; width],
            neighbours: vec![0.0; width],
            gradient: vec![0.0; width],
        };
        let mut sums = vec![none; groups.count()];
        let mut products = DMatrix::zeros(POSE + shared + 1, width);
        for (f, frame) in frames.iter().enumerate() {
            let values = self.columns.frames[f].columns(first_column, width);
            products.gemm(1.0, &frame.matrix, &values, 0.0);
            let sum = &mut sums[groups.of_frame(f)];
            sum.cross += products.rows(POSE, shared);
            for c in 0..width {
                let column = values.column(c);
                let of_pose = products.view((0, c), (POSE, 1));
                sum.squares[c] +=
                    weighted_dot(&frame.weights, column.as_slice(), column.as_slice()) - of_pose.norm_squared();
                sum.gradient[c] += products[(POSE + shared, c)];
            }
            for (function, start) in
                run.clone().map(|f| (&self.columns.functions[f], self.columns.starts[f] - first_column))
            {
                if function.kind.columns() == 2 {
                    let of_pose = |c: usize| products.view((0, c), (POSE, 1));
                    let (sine, cosine) = (values.column(start), values.column(start + 1));
                    let product = weighted_dot(&frame.weights, sine.as_slice(), cosine.as_slice());
                    sum.neighbours[start] += product - of_pose(start).dot(&of_pose(start + 1));
                }
            }
        }
        let cross = sums.iter().fold(DMatrix::zeros(shared, width), |all, sum| all + &sum.cross);
        let carried = of_shared.solve(&cross);
        // Scores without what the shared columns take up of each column.
        for (f, frame) in observations.frames.iter().enumerate() {
            let taken: DVector<f64> = carried.tr_mul(frame.rows.gradient());
            let sum = &mut sums[groups.of_frame(f)];
            sum.gradient.iter_mut().zip(&taken).for_each(|(gradient, taken)| *gradient -= taken);
        }
        // Information of each column by group, and with the next column: H_cc − H_cs A − Aᵀ H_sc + Aᵀ H_ss A with A = `carried`.
        for (sum, hessian) in sums.iter_mut().zip(&groups.hessians) {
            let through = hessian * &carried - &sum.cross;
            for c in 0..width {
                let with = |other: usize| {
                    carried.column(c).dot(&through.column(other)) - sum.cross.column(c).dot(&carried.column(other))
                };
                let (square, next) = (with(c), if c + 1 < width { with(c + 1) } else { 0.0 });
                sum.squares[c] += square;
                sum.neighbours[c] += next;
            }
        }
        run.filter_map(|index| {
            let function = &self.columns.functions[index];
            let (first, count) = (self.columns.starts[index] - first_column, function.kind.columns());
            let parts: Vec<Part> = sums.iter().map(|sum| sum.part(first, count)).collect();
            let term = Term::new(self.of, self.on, Product { factor: self.factor, function: *function });
            Screened::of_parts(term, &parts, |c| cross.column(first + c).dot(&carried.column(first + c)))
        })
        .collect()
    }
}
