//! Component and residual plots of a formula: the residuals without it and its own value, averaged over bins of its first
//! covariate (Larsen and McCleary 1972).

use depthcal_formula::{FormulaCovariate as C, FormulaEffect};
use depthcal_io::{
    DiagnosisComponent as Component, DiagnosisComponentBin as ComponentBin, DiagnosisCovariatePart as CovariatePart,
};
use depthcal_model::{Of, Options};

use super::observations::{Observations, Sample};
use crate::calibrate::CalibratedCamera;
use crate::diagnose::observed_states::Range;

/// Bins over the first covariate.
const BINS: usize = 24;
/// Parts of the range of the second one.
const PARTS: usize = 3;
/// Samples that a bin needs.
const LEAST_SAMPLES: usize = 8;

/// Values of one sample: both covariates, residual without the formula and the formula's value, mm.
struct Point {
    frame: usize,
    at: f64,
    second: f64,
    residual_mm: f64,
    formula_mm: f64,
}

/// The components of a formula in a fit that has it. Empty where its frames cannot be evaluated or the fit has no such effect.
pub fn components(fit: &CalibratedCamera, effect: &FormulaEffect, of: Of) -> Vec<Component> {
    let covariates: Vec<C> = effect.covariates().to_vec();
    let (Some(block), Some(first)) = (fit.camera.block(effect.name()), covariates.first().copied()) else {
        return Vec::new();
    };
    let Some(observations) = Observations::of(fit) else { return Vec::new() };
    let piece = effect.piece(&Options::new());
    let point = |frame: usize, sample: &Sample| {
        let [x, y, true_rho, cosine] = sample.state;
        let rho = if of == Of::True { true_rho } else { sample.measured_rho };
        let mut changed = [0.0];
        piece.evaluate(&block.theta, &[x, y, rho, cosine], &[sample.context], &mut changed);
        // A small change of inverse depth is one of −1/ρ² times as much of depth; the residual is measured minus predicted.
        let mm = |change: f64| -change / (rho * rho);
        let formula_mm = mm(changed[0] - rho);
        let slope = sample.slopes[usize::from(of == Of::Measured)];
        let value = sample.value(first, of);
        let second = covariates.get(1).map_or(0.0, |c| sample.value(*c, of));
        let residual_mm = formula_mm + mm(-sample.residual / slope);
        let is_known = [value, second, residual_mm].iter().all(|v| v.is_finite());
        is_known.then_some(Point { frame, at: value, second, residual_mm, formula_mm })
    };
    let points: Vec<Point> = observations
        .frames
        .iter()
        .enumerate()
        .flat_map(|(i, frame)| frame.samples.iter().filter_map(move |sample| point(i, sample)))
        .collect();
    let mut seconds: Vec<f64> = points.iter().map(|p| p.second).collect();
    seconds.sort_by(f64::total_cmp);
    let quantile = |k: usize| seconds[(seconds.len() - 1) * k / PARTS];
    match covariates.get(1) {
        _ if points.is_empty() => Vec::new(),
        None => {
            vec![Component {
                over: first.name().to_owned(),
                part_of: None,
                bins: bins(&points.iter().collect::<Vec<_>>()),
            }]
        }
        Some(second) => (0..PARTS)
            .map(|k| {
                let (low, high) = (quantile(k), quantile(k + 1));
                let is_last = k + 1 == PARTS;
                let inside: Vec<&Point> =
                    points.iter().filter(|p| p.second >= low && (p.second < high || is_last)).collect();
                let part_of = Some(CovariatePart { covariate: second.name().to_owned(), range: [low, high] });
                Component { over: first.name().to_owned(), part_of, bins: bins(&inside) }
            })
            .collect(),
    }
}

fn bins(points: &[&Point]) -> Vec<ComponentBin> {
    let Some(range) = Range::of(points.iter().map(|p| p.at)).filter(|range| range.span() > 0.0) else {
        return Vec::new();
    };
    let of_bin = |at: f64| (((at - range.low) / range.span() * BINS as f64) as usize).min(BINS - 1);
    let mut sorted: Vec<Vec<&Point>> = vec![Vec::new(); BINS];
    for point in points.iter().filter(|p| p.at >= range.low && p.at <= range.high) {
        sorted[of_bin(point.at)].push(point);
    }
    let bin = |points: Vec<&Point>| {
        if points.len() < LEAST_SAMPLES {
            return None;
        }
        let mean = |value: fn(&Point) -> f64| points.iter().map(|p| value(p)).sum::<f64>() / points.len() as f64;
        Some(ComponentBin {
            at: mean(|p| p.at),
            residual_mm: mean(|p| p.residual_mm),
            standard_error_mm: standard_error(&points),
            formula_mm: mean(|p| p.formula_mm),
        })
    };
    sorted.into_iter().filter_map(bin).collect()
}

/// Standard error of the mean residual over frames, whose samples have errors in common; `None` with a single frame.
fn standard_error(points: &[&Point]) -> Option<f64> {
    let mean = points.iter().map(|p| p.residual_mm).sum::<f64>() / points.len() as f64;
    let mut sums: std::collections::BTreeMap<usize, f64> = std::collections::BTreeMap::new();
    points.iter().for_each(|p| *sums.entry(p.frame).or_default() += p.residual_mm - mean);
    let (frames, n) = (sums.len() as f64, points.len() as f64);
    if frames < 2.0 {
        return None;
    }
    Some((sums.values().map(|sum| sum * sum).sum::<f64>() * frames / (frames - 1.0)).sqrt() / n)
}
