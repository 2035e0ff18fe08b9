//! The scores of all terms of the library: thousands of columns against rows that exist.

use depthcal_formula::FormulaCovariate as C;
use depthcal_model::chain::POSE;
use depthcal_model::{Of, On};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::library::{Density, Function, MOST_COLUMNS, factors, functions};
use super::observations::{FrameRows, Observations};
use super::term::{Product, Term, family};

/// The covariates of the library.
const COVARIATES: [C; 12] =
    [C::X, C::Y, C::R, C::U, C::V, C::Z, C::Rho, C::Range, C::Incidence, C::Amplitude, C::Time, C::Temperature];
/// Those that others are multiplied with.
const FACTORS: [C; 7] = [C::X, C::Y, C::R, C::Incidence, C::Amplitude, C::Time, C::Temperature];

/// A term with its score when camera and poses are estimated together with it.
#[derive(Debug, Clone)]
pub(super) struct Screened {
    pub term: Term,
    /// Score of every column, by frame, or by group of neighbouring frames where there are very many.
    pub parts: Vec<[f64; MOST_COLUMNS]>,
    /// The inverse of the information of its columns: [11, 12, 22].
    inverse: [f64; 3],
}

impl Screened {
    /// Score statistic Uᵀ V⁻¹ U of the weighted sum of the frames' scores.
    #[inline]
    pub fn statistic(&self, weight: impl Fn(usize) -> f64) -> f64 {
        let [mut a, mut b] = [0.0; 2];
        for (i, part) in self.parts.iter().enumerate() {
            let w = weight(i);
            a += w * part[0];
            b += w * part[1];
        }
        let [aa, ab, bb] = self.inverse;
        aa * a * a + 2.0 * ab * a * b + bb * b * b
    }

    /// What every frame, or group of frames, contributes to the statistic of their weighted sum.
    pub fn contributions(&self, weights: &[f64]) -> Vec<f64> {
        let [mut a, mut b] = [0.0; 2];
        for (part, w) in self.parts.iter().zip(weights) {
            a += w * part[0];
            b += w * part[1];
        }
        let [aa, ab, bb] = self.inverse;
        let (by_a, by_b) = (aa * a + ab * b, ab * a + bb * b);
        self.parts.iter().zip(weights).map(|(part, w)| w * (part[0] * by_a + part[1] * by_b)).collect()
    }

    /// The statistic less what its second column is expected to explain of noise, so that terms compare.
    pub fn merit(&self, weight: impl Fn(usize) -> f64) -> f64 {
        self.statistic(weight) - PENALTY * (self.term.columns() as f64 - 1.0)
    }
}

/// Statistic that a further column has to explain. Its expectation under noise is 1, and that of the best of many phases about 2.
pub(super) const PENALTY: f64 = 2.0;

/// The functions whose products are screened together: all functions of other covariates, times one factor, in one place and form.
struct Job {
    of: Of,
    on: On,
    factor: Option<Function>,
    functions: Vec<Function>,
}

/// All terms of the library with their scores.
pub(super) fn screen(observations: &Observations) -> Vec<Screened> {
    let Some(factor) = observations.shared_hessian().cholesky() else { return Vec::new() };
    let mut jobs = Vec::new();
    for of in Of::ALL {
        let spans: Vec<_> = COVARIATES.iter().filter_map(|c| Some((*c, observations.span(*c, of)?))).collect();
        let all = |density: Density, apart_from: Option<C>| -> Vec<Function> {
            let others = spans.iter().filter(|(c, _)| apart_from.is_none_or(|other| family(*c) != family(other)));
            others.flat_map(|(c, span)| functions(*c, *span, density)).collect()
        };
        for on in On::ALL {
            jobs.push(Job { of, on, factor: None, functions: all(Density::Fine, None) });
            for (c, span) in spans.iter().filter(|(c, _)| FACTORS.contains(c)) {
                for factor in factors(*c, *span) {
                    let mut functions = all(Density::Coarse, Some(*c));
                    // Two factors in either order are one product.
                    let place = |c: &C| FACTORS.iter().position(|f| f == c);
                    functions
                        .retain(|f| f.kind.is_searched() || place(&f.covariate).is_none_or(|p| Some(p) > place(c)));
                    jobs.push(Job { of, on, factor: Some(factor), functions });
                }
            }
        }
    }
    jobs.par_iter()
        .flat_map_iter(|job| {
            job.functions
                .chunks(CHUNK)
                .flat_map(|functions| scores(observations, &factor, job, functions))
                .collect::<Vec<_>>()
        })
        .collect()
}

/// Groups of frames whose scores are kept apart.
const MOST_GROUPS: usize = 48;
/// Functions whose columns are multiplied together.
const CHUNK: usize = 48;

fn scores(
    observations: &Observations,
    of_shared: &nalgebra::Cholesky<f64, nalgebra::Dyn>,
    job: &Job,
    functions: &[Function],
) -> Vec<Screened> {
    let (shared, frames) = (observations.shared, observations.frames.len());
    let groups = frames.min(MOST_GROUPS);
    let group = |frame: usize| frame * groups / frames;
    let width: usize = functions.iter().map(|f| f.kind.columns()).sum();
    // Per column: sums over the frames with the shared columns, of squares, of products of neighbours; gradients by frame.
    let mut cross = DMatrix::<f64>::zeros(shared, width);
    let (mut squares, mut neighbours) = (vec![0.0; width], vec![0.0; width]);
    let mut parts = DMatrix::<f64>::zeros(groups, width);
    for (f, frame) in observations.frames.iter().enumerate() {
        let columns = frame.columns_of(job, functions, width);
        let products = frame.matrix().tr_mul(&columns);
        cross += products.rows(POSE, shared);
        let mut row = parts.row_mut(group(f));
        row += products.row(POSE + shared);
        for c in 0..width {
            let (own, of_pose) = (columns.column(c), products.view((0, c), (POSE, 1)));
            squares[c] += own.norm_squared() - of_pose.norm_squared();
            if c + 1 < width {
                let next = products.view((0, c + 1), (POSE, 1));
                neighbours[c] += own.dot(&columns.column(c + 1)) - of_pose.dot(&next);
            }
        }
    }
    let carried = of_shared.solve(&cross);
    // Scores without what the shared columns take up of each column.
    for (f, frame) in observations.frames.iter().enumerate() {
        let taken: DVector<f64> = carried.tr_mul(frame.gradient());
        let mut row = parts.row_mut(group(f));
        row -= taken.transpose();
    }
    let mut next = 0;
    functions
        .iter()
        .filter_map(|function| {
            let (first, count) = (next, function.kind.columns());
            next += count;
            let left = |c: usize| squares[c] - cross.column(c).dot(&carried.column(c));
            let a = left(first);
            // What the others explain of a column must leave something of it.
            if !(a > LEAST_LEFT * squares[first]) {
                return None;
            }
            let inverse = if count == 1 {
                [a.recip(), 0.0, 0.0]
            } else {
                let b = left(first + 1);
                let ab = neighbours[first] - cross.column(first).dot(&carried.column(first + 1));
                let determinant = a * b - ab * ab;
                if !(b > LEAST_LEFT * squares[first + 1] && determinant > LEAST_LEFT * a * b) {
                    return None;
                }
                [b / determinant, -ab / determinant, a / determinant]
            };
            let product = Product { factor: job.factor, function: *function };
            let part = |g: usize| [parts[(g, first)], if count == 2 { parts[(g, first + 1)] } else { 0.0 }];
            let parts = (0..groups).map(part).collect();
            Some(Screened { term: Term::new(job.of, job.on, product), parts, inverse })
        })
        .collect()
}

/// Share of a column's information that the other columns must leave.
const LEAST_LEFT: f64 = 1e-4;

impl FrameRows {
    fn columns_of(&self, job: &Job, functions: &[Function], width: usize) -> DMatrix<f64> {
        let mut columns = DMatrix::zeros(self.samples.len(), width);
        for (row, sample) in self.samples.iter().enumerate() {
            let slope = sample.slope(job.of, job.on);
            let scale = slope * job.factor.map_or(1.0, |f| f.values(sample.value(f.covariate, job.of))[0]);
            let (mut next, mut known) = (0, None);
            for function in functions {
                // Functions of a covariate follow each other.
                let value = match known {
                    Some((covariate, value)) if covariate == function.covariate => value,
                    _ => sample.value(function.covariate, job.of),
                };
                known = Some((function.covariate, value));
                let values = function.values(value);
                for value in &values[..function.kind.columns()] {
                    let entry = scale * value;
                    columns[(row, next)] = if entry.is_finite() { entry } else { 0.0 };
                    next += 1;
                }
            }
        }
        columns
    }
}
