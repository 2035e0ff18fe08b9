//! Ranking of fitted variants by their held-out error, with intervals for errors and for differences from the best.

use std::collections::{BTreeMap, BTreeSet};

use depthcal_io::{Errors, Interval, ModelComparison};

use super::errors::{FrameErrors, interval, resampled};
use super::information_criteria::{JointFit, criteria};

/// Share of resampled values outside an interval: 95 % intervals.
const OUTSIDE: f64 = 0.05;

/// A variant, fitted and evaluated.
pub(super) struct EvaluatedVariant {
    /// Its record, so far without intervals, criteria and rank.
    pub record: ModelComparison,
    /// Errors of the held-out frames, by dataset.
    pub held_out: Vec<Vec<FrameErrors>>,
    /// The fit, for AIC and BIC; `None` of other estimators than the joint adjustment.
    pub joint: Option<JointFit>,
}

/// Leaves the held-out frames that were judged under all variants: errors of other frames are no comparison.
fn retain_common_frames(evaluated: &mut [EvaluatedVariant]) {
    let fitted = || evaluated.iter().filter(|variant| variant.record.failed.is_none());
    let names_of = |frames: &Vec<FrameErrors>| frames.iter().map(|f| f.name.clone()).collect::<BTreeSet<String>>();
    let datasets = fitted().map(|variant| variant.held_out.len()).min().unwrap_or(0);
    let common: Vec<BTreeSet<String>> = (0..datasets)
        .map(|d| fitted().map(|v| names_of(&v.held_out[d])).reduce(|a, b| &a & &b).unwrap_or_default())
        .collect();
    for variant in evaluated {
        variant.held_out.iter_mut().zip(&common).for_each(|(frames, names)| frames.retain(|f| names.contains(&f.name)));
    }
}

/// Intervals and criteria of all variants, of which the first `listed` are those asked for. Returns the records of the
/// listed ones, best first, and those of all in the given order.
pub(super) fn rank(
    mut evaluated: Vec<EvaluatedVariant>,
    listed: usize,
) -> (Vec<ModelComparison>, Vec<ModelComparison>) {
    let good: Vec<usize> = (0..evaluated.len()).filter(|i| evaluated[*i].record.failed.is_none()).collect();
    retain_common_frames(&mut evaluated);
    let held: Vec<&[Vec<FrameErrors>]> = good.iter().map(|i| evaluated[*i].held_out.as_slice()).collect();
    let mut results: BTreeMap<usize, (Errors<_>, Vec<f64>)> = good.iter().copied().zip(resampled(&held)).collect();
    let error = |e: &Errors<Option<Interval>>| e.dot_error_mm.or(e.depth_rms_mm).map_or(f64::INFINITY, |i| i.mean);
    let mut by_error: Vec<(usize, f64)> =
        (0..listed).filter_map(|i| results.get(&i).map(|r| (i, error(&r.0)))).collect();
    by_error.sort_by(|a, b| a.1.total_cmp(&b.1));
    let best = by_error.first().map(|(i, value)| (results[i].1.clone(), *value));
    // The noise of the one that predicts best is nearest to that of the measurements alone.
    let noise = by_error.iter().find_map(|(i, _)| Some(evaluated[*i].joint.as_ref()?.noise()));
    let joint = evaluated[..listed].iter_mut().enumerate().filter_map(|(i, e)| Some((i, e.joint.take()?))).collect();
    let criteria = noise.map_or_else(BTreeMap::new, |noise| criteria(joint, &noise));
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
