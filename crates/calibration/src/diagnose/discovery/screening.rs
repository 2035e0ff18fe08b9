//! The scores of all terms of the library: thousands of columns against rows that exist.

use depthcal_formula::FormulaCovariate as C;
use depthcal_model::chain::POSE;
use depthcal_model::{Of, On};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::library::{Density, Function, MOST_COLUMNS, factors, functions};
use super::observations::{FrameRows, Observations};
use super::score::Score;
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
    /// What the term, estimated from the other frames, leaves of each part.
    unexplained: Vec<[f64; MOST_COLUMNS]>,
    /// The inverse of the information of its columns: [11, 12, 22].
    inverse: [f64; 3],
}

impl Screened {
    /// A term of one product with its score in so many groups of frames; `None` where the shared columns take it up.
    pub fn of(observations: &Observations, term: &Term, groups: usize) -> Option<Self> {
        let score = Score::of(&observations.normals(term), observations.shared)?;
        let (columns, frames) = (term.columns(), score.parts.len());
        if columns > MOST_COLUMNS {
            return None;
        }
        let mut parts = vec![[0.0; MOST_COLUMNS]; groups];
        for (frame, part) in score.parts.iter().enumerate() {
            let sum = &mut parts[frame * groups / frames];
            sum.iter_mut().zip(part).for_each(|(sum, part)| *sum += part);
        }
        let of = |i: usize, j: usize| if i.max(j) < columns { score.information[(i, j)] } else { 0.0 };
        let information = [of(0, 0), of(0, 1), of(1, 1)];
        (information[0] > 0.0).then(|| Self {
            term: term.clone(),
            parts,
            unexplained: Vec::new(),
            inverse: inverted(information, columns),
        })
    }

    /// Score statistic Uᵀ V⁻¹ U of the weighted sum of the frames' scores.
    #[inline]
    pub fn statistic(&self, weight: impl Fn(usize) -> f64) -> f64 {
        self.statistic_of(&self.parts, weight)
    }

    /// The same of weighted parts.
    #[inline]
    fn statistic_of(&self, parts: &[[f64; MOST_COLUMNS]], weight: impl Fn(usize) -> f64) -> f64 {
        let [mut a, mut b] = [0.0; 2];
        for (i, part) in parts.iter().enumerate() {
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
        self.statistic(weight) - self.penalty()
    }

    /// The merit that chance gives where frames have these signs: without what frames have in common.
    pub fn merit_by_chance(&self, signs: &[f64]) -> f64 {
        self.statistic_of(&self.unexplained, |i| signs[i]) - self.penalty()
    }

    fn penalty(&self) -> f64 {
        PENALTY * (self.term.columns() as f64 - 1.0)
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
    let groups = Groups::of(observations);
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
                .flat_map(|functions| scores(observations, &groups, &factor, job, functions))
                .collect::<Vec<_>>()
        })
        .collect()
}

/// Groups of frames whose scores are kept apart.
const MOST_GROUPS: usize = 48;
/// Functions whose columns are multiplied together.
const CHUNK: usize = 48;

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
            groups.hessians[group] += frame.hessian();
        }
        groups
    }

    fn count(&self) -> usize {
        self.hessians.len()
    }

    fn of_frame(&self, frame: usize) -> usize {
        frame * self.count() / self.frames
    }
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

fn scores(
    observations: &Observations,
    groups: &Groups,
    of_shared: &nalgebra::Cholesky<f64, nalgebra::Dyn>,
    job: &Job,
    functions: &[Function],
) -> Vec<Screened> {
    let shared = observations.shared;
    let width: usize = functions.iter().map(|f| f.kind.columns()).sum();
    let none = OfGroup {
        cross: DMatrix::zeros(shared, width),
        squares: vec![0.0; width],
        neighbours: vec![0.0; width],
        gradient: vec![0.0; width],
    };
    let mut sums = vec![none; groups.count()];
    for (f, frame) in observations.frames.iter().enumerate() {
        let columns = frame.columns_of(job, functions, width);
        let products = frame.matrix().tr_mul(&columns);
        let sum = &mut sums[groups.of_frame(f)];
        sum.cross += products.rows(POSE, shared);
        for c in 0..width {
            let (own, of_pose) = (columns.column(c), products.view((0, c), (POSE, 1)));
            sum.squares[c] += own.norm_squared() - of_pose.norm_squared();
            sum.gradient[c] += products[(POSE + shared, c)];
            if c + 1 < width {
                let next = products.view((0, c + 1), (POSE, 1));
                sum.neighbours[c] += own.dot(&columns.column(c + 1)) - of_pose.dot(&next);
            }
        }
    }
    let cross = sums.iter().fold(DMatrix::zeros(shared, width), |all, sum| all + &sum.cross);
    let carried = of_shared.solve(&cross);
    // Scores without what the shared columns take up of each column.
    for (f, frame) in observations.frames.iter().enumerate() {
        let taken: DVector<f64> = carried.tr_mul(frame.gradient());
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
            let (own, next) = (with(c), if c + 1 < width { with(c + 1) } else { 0.0 });
            sum.squares[c] += own;
            sum.neighbours[c] += next;
        }
    }
    let mut next = 0;
    functions
        .iter()
        .filter_map(|function| {
            let (first, count) = (next, function.kind.columns());
            next += count;
            let of_groups: Vec<Part> = sums.iter().map(|sum| Part::of(sum, first, count)).collect();
            let (inverse, unexplained) = explained(&of_groups, |c| {
                let taken = cross.column(first + c).dot(&carried.column(first + c));
                LEAST_LEFT * taken
            })?;
            let product = Product { factor: job.factor, function: *function };
            let parts = of_groups.iter().map(|part| part.gradient).collect();
            Some(Screened { term: Term::new(job.of, job.on, product), parts, unexplained, inverse })
        })
        .collect()
}

/// Squared mean of the groups' scores over its variance from group to group from which a term counts as shared in part.
const LEAST_AGREEMENT: f64 = 3.0;

/// Score and information of a term in a group of frames.
struct Part {
    gradient: [f64; MOST_COLUMNS],
    /// [11, 12, 22].
    information: [f64; 3],
    columns: usize,
}

impl Part {
    fn of(sum: &OfGroup, first: usize, columns: usize) -> Self {
        if columns == 1 {
            return Self { gradient: [sum.gradient[first], 0.0], information: [sum.squares[first], 0.0, 0.0], columns };
        }
        let second = first + 1;
        Self {
            gradient: [sum.gradient[first], sum.gradient[second]],
            information: [sum.squares[first], sum.neighbours[first], sum.squares[second]],
            columns,
        }
    }
}

/// Inverse of the information of a term, and what it leaves of every part when it is estimated from the other groups, as far as these agree
/// (James, Stein 1961). `None` where the shared columns leave less of a column than `least`, or where its two columns are one.
fn explained(parts: &[Part], least: impl Fn(usize) -> f64) -> Option<([f64; 3], Vec<[f64; MOST_COLUMNS]>)> {
    let mut information = [0.0; 3];
    let mut score = [0.0; MOST_COLUMNS];
    for part in parts {
        (0..3).for_each(|i| information[i] += part.information[i]);
        (0..MOST_COLUMNS).for_each(|i| score[i] += part.gradient[i]);
    }
    let columns = parts.first()?.columns;
    let is_determined = |[a, ab, b]: [f64; 3]| {
        a > LEAST_LEFT * information[0]
            && (columns == 1 || (b > LEAST_LEFT * information[2] && a * b - ab * ab > LEAST_LEFT * a * b))
    };
    let is_left = |c: usize, of: f64| of > least(c);
    if !(is_left(0, information[0]) && (columns == 1 || is_left(1, information[2])) && is_determined(information)) {
        return None;
    }
    let inverse = inverted(information, columns);
    let statistic = |v: [f64; MOST_COLUMNS]| dot(v, product(inverse, v));
    let total: f64 = parts.iter().map(|part| statistic(part.gradient)).sum();
    let unexplained = parts.iter().map(|part| {
        let own = part.gradient;
        let of_others = [score[0] - own[0], score[1] - own[1]];
        // As far as the other groups agree with each other: not at all where they show no more than the best of many terms by chance.
        let agreement = statistic(of_others) / (total - statistic(own)).max(f64::MIN_POSITIVE);
        let shrunk = (1.0 - LEAST_AGREEMENT / agreement).max(0.0);
        let information = [0, 1, 2].map(|i| information[i] - part.information[i]);
        if shrunk == 0.0 || !is_determined(information) {
            return own;
        }
        let predicted = product(part.information, product(inverted(information, columns), of_others));
        [own[0] - shrunk * predicted[0], own[1] - shrunk * predicted[1]]
    });
    Some((inverse, unexplained.collect()))
}

/// The inverse of a symmetric matrix [11, 12, 22], or of its first element.
fn inverted([a, ab, b]: [f64; 3], columns: usize) -> [f64; 3] {
    if columns == 1 {
        return [a.recip(), 0.0, 0.0];
    }
    let determinant = a * b - ab * ab;
    [b / determinant, -ab / determinant, a / determinant]
}

fn dot(a: [f64; MOST_COLUMNS], b: [f64; MOST_COLUMNS]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

/// A symmetric matrix [11, 12, 22] times a vector.
fn product([a, ab, b]: [f64; 3], v: [f64; MOST_COLUMNS]) -> [f64; MOST_COLUMNS] {
    [a * v[0] + ab * v[1], ab * v[0] + b * v[1]]
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
