//! Functions that the residuals of a factor graph depend on.

use std::collections::BTreeSet;

use nalgebra::DMatrix;

use super::axis::{Axis, CUBIC};
use super::model::{Additive, Cluster, Group, Table};
use super::normal::Normal;
use super::rows::ClusterRows;
use super::search::search;
use super::strengths::Strengths;
use crate::problem::graph::{BatchId, Graph};
use crate::problem::key::VariableId;
use crate::problem::values::Values;
use crate::score::ScoreError;
use crate::score::structure::{BatchRows, Structure};

/// Rows that take part, about: the products of all columns take most of the time.
const MOST_ROWS: usize = 6000;
/// Basis functions along each of two covariates.
const PAIRED: usize = 7;

/// A quantity on which residuals may depend.
#[derive(Debug, Clone, PartialEq)]
pub struct Covariate {
    /// Name for reports.
    pub name: String,
    /// Basis functions of a smooth function of it, at least 4.
    pub basis_functions: usize,
    /// Whether it grows from cluster to cluster, as time does. Blocks of consecutive clusters are then extrapolations.
    pub is_sequential: bool,
}

impl Covariate {
    /// A covariate that does not grow from cluster to cluster, with twelve basis functions.
    pub fn new(name: impl Into<String>) -> Self {
        Self { name: name.into(), basis_functions: 12, is_sequential: false }
    }
}

/// Values that a scalar residual depends on.
#[derive(Debug, Clone, PartialEq)]
pub struct Observed {
    /// Values of the covariates; NaN where unknown.
    pub covariates: Vec<f64>,
    /// Change of the whitened residual by a missing function of value 1: 1/σ of an effect that is added to what is predicted.
    pub slope: f64,
}

/// A smooth function of one or two covariates that the residuals depend on.
#[derive(Debug, Clone)]
pub struct MissingFunction {
    /// Names of its covariates.
    pub covariates: Vec<String>,
    /// Share of the squared residuals of left-out clusters that it explains, given all others.
    pub share: f64,
    parts: Vec<Part>,
}

/// A spline times a factor, with its coefficients.
#[derive(Debug, Clone)]
struct Part {
    axes: Vec<(usize, Axis)>,
    /// Number and mean of the covariate that it is multiplied with.
    factor: Option<(usize, f64)>,
    coefficients: Vec<f64>,
}

impl MissingFunction {
    /// Its value where the covariates, all of them in the order of the search, are these. Beyond the observed range it is
    /// constant along every covariate. A part that the fitted variables can represent is undetermined in it.
    pub fn value(&self, covariates: &[f64]) -> f64 {
        self.parts.iter().map(|part| part.value(covariates)).sum()
    }
}

impl Part {
    fn value(&self, covariates: &[f64]) -> f64 {
        let factor = self.factor.map_or(1.0, |(number, mean)| covariates[number] - mean);
        let basis = |(number, axis): &(usize, Axis)| axis.basis(covariates[*number]);
        let spline: f64 = match &self.axes[..] {
            [] => self.coefficients[0],
            [along] => {
                let (first, values) = basis(along);
                values.iter().zip(&self.coefficients[first..]).map(|(value, c)| value * c).sum()
            }
            [along, across, ..] => {
                let ((first, values), (first_row, of_rows)) = (basis(along), basis(across));
                let of_row = |(row, value): (usize, &f64)| {
                    let coefficients = &self.coefficients[(first_row + row) * along.1.count + first..];
                    value * values.iter().zip(coefficients).map(|(value, c)| value * c).sum::<f64>()
                };
                of_rows.iter().enumerate().map(of_row).sum()
            }
        };
        factor * spline
    }
}

/// The functions of some covariates that the residuals of a batch depend on, at the minimum of the graph over its free variables:
/// smooth functions of one covariate, alone or times another, and of two, selected jointly on left-out clusters, so that two that
/// hide each other are found. None of them is chance: with each, given all others, most clusters become better (Wilcoxon's test
/// at 1 %).
///
/// Groups of residuals that depend on the variable `clusters[i]` form cluster i: a run, a frame, a subject. Residuals within a
/// cluster may share any error that its own variables take up, but else have to be independent. `observed` has what the scalar
/// residuals of `batch` depend on, by their number in it.
///
/// # Errors
///
/// [`ScoreError`] if a factor cannot be evaluated.
///
/// # Panics
///
/// If `observed` returns another number of covariates.
pub fn missing_functions(
    graph: &Graph,
    values: &Values,
    clusters: &[VariableId],
    batch: BatchId,
    covariates: &[Covariate],
    observed: impl Fn(usize) -> Observed,
) -> Result<Vec<MissingFunction>, ScoreError> {
    let structure = Structure::of(graph, values, clusters, &[])?;
    let rows = (0..clusters.len()).map(|cluster| structure.rows(graph, values, cluster, batch));
    let rows: Vec<BatchRows> = rows.collect::<Result<_, ScoreError>>()?;
    let total: usize = rows.iter().map(|rows| rows.numbers.len()).sum();
    let step = total.div_ceil(MOST_ROWS).max(1);
    let thinned = rows.iter().filter_map(|rows| thinned_rows(rows, step));
    let taken: Vec<(ClusterRows, Vec<Observed>)> =
        thinned.map(|(rows, numbers)| (rows, numbers.into_iter().map(&observed).collect())).collect();
    for (_, observed) in &taken {
        assert!(observed.iter().all(|o| o.covariates.len() == covariates.len()), "one value for every covariate");
    }
    let library = Library::new(covariates, &taken);
    let model = library.model(&taken);
    let functions = search(&model);
    let Some(strengths) = Strengths::best(&model, &functions) else { return Ok(Vec::new()) };
    let coefficients = strengths.coefficients();
    let mut next = 0;
    let function = |found: &super::search::Found| {
        let mut part = |group: &usize| {
            let (Group { axes, .. }, factor) = (&model.groups[*group], library.factor_of[*group]);
            let range = next..next + model.groups[*group].count();
            next = range.end;
            let factor = factor.map(|number| (number, library.means[number]));
            Part { axes: axes.clone(), factor, coefficients: coefficients.as_slice()[range].to_vec() }
        };
        let parts = found.groups.iter().map(&mut part).collect();
        let names = found.covariates.iter().map(|number| covariates[*number].name.clone()).collect();
        MissingFunction { covariates: names, share: found.share, parts }
    };
    Ok(functions.iter().map(function).collect())
}

/// Every so-many-th row of a cluster, with its own variables eliminated, and the rows' numbers; `None` where these rows and all
/// other residuals do not determine the own variables.
fn thinned_rows(all: &BatchRows, step: usize) -> Option<(ClusterRows, Vec<usize>)> {
    let taken: Vec<usize> = (0..all.numbers.len()).step_by(step).collect();
    let (jacobian, residuals) = (all.jacobian.select_rows(&taken), all.residuals.select_rows(&taken));
    let (mut hessian, mut gradient) = all.others.clone();
    hessian.gemm_tr(1.0, &jacobian, &jacobian, 1.0);
    gradient.gemm_tr(1.0, &jacobian, &residuals, 1.0);
    let rows = ClusterRows::new(&jacobian, &residuals, &Normal { hessian, gradient }, all.local)?;
    Some((rows, taken.iter().map(|row| all.numbers[*row]).collect()))
}

/// The groups of functions of some covariates.
struct Library {
    groups: Vec<Group>,
    /// The covariate that every group is multiplied with.
    factor_of: Vec<Option<usize>>,
    means: Vec<f64>,
    sequential: BTreeSet<usize>,
}

impl Library {
    fn new(covariates: &[Covariate], clusters: &[(ClusterRows, Vec<Observed>)]) -> Self {
        let values = |number: usize| {
            let rows = clusters.iter().flat_map(|(_, observed)| observed);
            rows.map(move |o| o.covariates[number]).filter(|value| value.is_finite())
        };
        let numbers = 0..covariates.len();
        let mean = |number: usize| values(number).sum::<f64>() / values(number).count().max(1) as f64;
        let ends = |number: usize| {
            values(number).fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)])
        };
        let varying: Vec<(usize, [f64; 2])> =
            numbers.clone().map(|n| (n, ends(n))).filter(|(_, [low, high])| high > low).collect();
        let mut library = Self {
            groups: Vec::new(),
            factor_of: Vec::new(),
            means: numbers.clone().map(mean).collect(),
            sequential: numbers.filter(|n| covariates[*n].is_sequential).collect(),
        };
        let mut add = |axes: Vec<(usize, Axis)>, factor: Option<usize>| {
            let covariates_of: BTreeSet<usize> = axes.iter().map(|(number, _)| *number).chain(factor).collect();
            let names: Vec<&str> = covariates_of.iter().map(|number| covariates[*number].name.as_str()).collect();
            let weight = factor.map_or(0, |number| number + 1);
            library.groups.push(Group { axes, weight, words: names.join("·"), covariates: covariates_of });
            library.factor_of.push(factor);
        };
        for (place, (number, [low, high])) in varying.iter().enumerate() {
            let axis = |count: usize| Axis { low: *low, high: *high, count: count.max(CUBIC + 1), degree: CUBIC };
            add(vec![(*number, axis(covariates[*number].basis_functions))], None);
            for (other, [low, high]) in &varying {
                if other != number {
                    add(vec![(*number, axis(covariates[*number].basis_functions))], Some(*other));
                }
                let is_later = varying[place + 1..].iter().any(|(later, _)| later == other);
                if is_later {
                    let across = Axis { low: *low, high: *high, count: PAIRED, degree: CUBIC };
                    add(vec![(*number, axis(PAIRED)), (*other, across)], None);
                }
            }
        }
        library
    }

    fn model<'a>(&self, clusters: &'a [(ClusterRows, Vec<Observed>)]) -> Additive<'a> {
        let table = |observed: &[Observed]| {
            let (rows, width) = (observed.len(), self.means.len());
            let covariates = DMatrix::from_fn(rows, width, |row, k| observed[row].covariates[k]);
            let weights = DMatrix::from_fn(rows, width + 1, |row, k| match k {
                0 => observed[row].slope,
                _ if covariates[(row, k - 1)].is_finite() => {
                    observed[row].slope * (covariates[(row, k - 1)] - self.means[k - 1])
                }
                _ => 0.0,
            });
            Table { covariates, weights }
        };
        let clusters = clusters.iter().map(|(rows, observed)| Cluster { rows, table: table(observed) }).collect();
        Additive { clusters, groups: self.groups.clone(), sequential: self.sequential.clone() }
    }
}
