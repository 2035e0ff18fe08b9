//! Search for the value of an effect's constant that explains most.

use depthcal_model::Register;
use depthcal_solver::score::ScoreError;
use rayon::prelude::*;

use super::candidate_blocks::{CandidateBlock, linearize};
use super::candidates::{Effect, around, finer, missing_effects};
use super::evidence::Evidence;
use super::observed_states::ObservedStates;
use super::thresholds::Thresholds;
use crate::calibrate::Calibrated;

/// Values that are tested in one linearisation: enough to share its cost, few enough to share the values among threads.
const VALUES_PER_LINEARIZATION: usize = 12;

/// The value with the largest score statistic, from a coarse search and then a fine one about its best value, and the factor by
/// which p-values are to be multiplied for the number of values.
///
/// # Errors
///
/// [`ScoreError`] where the problem cannot be evaluated.
pub(super) fn best_constant(
    fit: &Calibrated,
    register: &Register,
    effect: &Effect,
    thresholds: &Thresholds,
) -> Result<(Option<f64>, f64), ScoreError> {
    if effect.values.len() < 2 {
        return Ok((effect.values.first().copied(), 1.0));
    }
    let search = |values: &[f64]| -> Result<Vec<(f64, f64)>, ScoreError> {
        let chunks: Result<Vec<Vec<(f64, f64)>>, ScoreError> = values
            .par_chunks(VALUES_PER_LINEARIZATION)
            .map(|chunk| {
                let candidate = |v: &f64| CandidateBlock::effect(register, effect.spec(Some(*v)));
                let candidates: Vec<CandidateBlock> = chunk.iter().filter_map(candidate).collect();
                let linearization = linearize(fit, &candidates)?;
                Ok(chunk.iter().enumerate().map(|(i, v)| (*v, linearization.score(i).statistic)).collect())
            })
            .collect();
        Ok(chunks?.concat())
    };
    let best = |scores: &[(f64, f64)]| scores.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1));
    let coarse = search(&effect.values)?;
    let Some(mut found) = best(&coarse) else { return Ok((None, 1.0)) };
    if effect.refine && found.0.is_finite() {
        found = best(&search(&finer(&effect.values, found.0))?).filter(|f| f.1 > found.1).unwrap_or(found);
    }
    Ok((Some(found.0), (coarse.len() as f64 / thresholds.values_per_test).max(1.0)))
}

/// An effect that was added, with a better value of its constant, searched jointly with everything else that `fit` has;
/// `None` where the constant is not searched, has the best value already, or where parameters of the effect are held.
pub(super) fn refined_constant(fit: &Calibrated, register: &Register, added: &Evidence) -> Option<Evidence> {
    if added.reduced.as_ref() == Some(&added.spec) {
        return None;
    }
    let without = Calibrated { camera: fit.camera.filtered(|b| b.name() != added.name), ..fit.clone() };
    let states = ObservedStates::of(fit);
    let effect = missing_effects(register, &without.camera, &states).into_iter().find(|e| e.name == added.name)?;
    let values = if effect.afterwards.is_empty() {
        around(added.value.filter(|v| effect.refine && v.is_finite())?, &effect.values)
    } else {
        effect.afterwards.clone()
    };
    let candidate = |v: &f64| Some((*v, CandidateBlock::effect(register, effect.spec(Some(*v)))?));
    let (values, candidates): (Vec<f64>, Vec<CandidateBlock>) = values.iter().filter_map(candidate).unzip();
    let linearization = linearize(&without, &candidates).ok()?;
    let best = (0..candidates.len())
        .max_by(|a, b| linearization.score(*a).statistic.total_cmp(&linearization.score(*b).statistic))?;
    let spec = candidates[best].spec.clone();
    (spec != added.spec).then(|| Evidence { spec, value: Some(values[best]), ..added.clone() })
}
