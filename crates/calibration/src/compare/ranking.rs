//! Ranking of fitted variants by their held-out error, with intervals for errors and for differences from the best.

use std::collections::BTreeMap;

use depthcal_io::{Errors, Interval, ModelComparison};

use super::errors::{FrameErrors, interval, resampled};
use super::information_criteria::{Residuals, criteria};

/// Share of resampled values outside an interval: 95 % intervals.
const OUTSIDE: f64 = 0.05;

/// A variant, fitted and evaluated.
pub(super) struct EvaluatedVariant {
    /// Its record, so far without intervals, criteria and rank.
    pub record: ModelComparison,
    /// Errors of the held-out frames, by dataset.
    pub held_out: Vec<Vec<FrameErrors>>,
    /// Residuals of the fit, for AIC and BIC.
    pub residuals: Option<Residuals>,
}

/// Intervals and criteria of all variants, of which the first `listed` are those asked for. Returns the records of the
/// listed ones, best first, and those of all in the given order.
pub(super) fn rank(
    mut evaluated: Vec<EvaluatedVariant>,
    listed: usize,
) -> (Vec<ModelComparison>, Vec<ModelComparison>) {
    let good: Vec<usize> = (0..evaluated.len()).filter(|i| evaluated[*i].record.failed.is_none()).collect();
    let held: Vec<&[Vec<FrameErrors>]> = good.iter().map(|i| evaluated[*i].held_out.as_slice()).collect();
    let mut results: BTreeMap<usize, (Errors<_>, Vec<f64>)> = good.iter().copied().zip(resampled(&held)).collect();
    let error = |e: &Errors<Option<Interval>>| e.dot_error_mm.or(e.depth_rms_mm).map_or(f64::INFINITY, |i| i.mean);
    let best = (0..listed)
        .filter_map(|i| results.get(&i).map(|r| (i, error(&r.0))))
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(i, value)| (results[&i].1.clone(), value));
    let with_residuals = evaluated[..listed].iter_mut().enumerate();
    let criteria = criteria(with_residuals.filter_map(|(i, e)| Some((i, e.residuals.take()?))).collect());
    // Bonferroni over the comparisons with the best model: 5 % is the chance that any difference is called real by accident.
    let outside = OUTSIDE / (listed.max(2) - 1) as f64;
    let mut records: Vec<ModelComparison> = evaluated
        .into_iter()
        .enumerate()
        .map(|(i, evaluated)| {
            let mut record = evaluated.record;
            let Some((held_out, samples)) = results.remove(&i) else { return record };
            record.held_out = held_out;
            [record.aic, record.bic] = criteria.get(&i).map_or([None; 2], |c| c.map(Some));
            if let Some((reference, value)) = &best {
                let difference: Vec<f64> = samples.iter().zip(reference).map(|(a, b)| a - b).collect();
                let mean = error(&held_out) - value;
                record.worse_than_best_mm = Some(interval(mean, difference.clone(), OUTSIDE));
                record.really_worse = mean > 0.0 && interval(mean, difference, outside).low > 0.0;
            }
            record
        })
        .collect();
    let variants = records.clone();
    records.truncate(listed);
    records.sort_by(|a, b| {
        let key = |m: &ModelComparison| if m.failed.is_some() { f64::INFINITY } else { error(&m.held_out) };
        key(a).total_cmp(&key(b))
    });
    (records, variants)
}
