//! Search for the variant of an effect that explains most: the value of its constant, its place and its form.
//!
//! A wave over depth has another period in the measured depth than in the true one wherever D scales depth, and another phase
//! where D tilts it; in the wrong place no period explains it. So the constants of such effects are searched in both places.
//! Forms only weight the effect over distance: they are compared at the best constant of each place, and the constant is refined
//! in the best of them.

use depthcal_model::{Of, Placement, Register};
use depthcal_solver::score::Linearization;
use depthcal_statistics::mean_to_standard_error;
use rayon::prelude::*;

use super::candidate_blocks::{CandidateBlock, Fit};
use super::candidates::{Effect, around, finer, missing_effects};
use super::evidence::{Evidence, difference};
use super::observed_states::ObservedStates;
use super::thresholds::Thresholds;
use crate::calibrate::CalibratedCamera;

/// Variants that are tested in one linearisation: enough to share its cost, few enough to share the variants among threads.
const VARIANTS_PER_LINEARIZATION: usize = 24;

/// Fewest values of a constant that are compared on a part of the samples first.
const MANY_VALUES: usize = 16;
/// Of every so many samples of a frame one belongs to that part.
const SAMPLE_STEP: usize = 3;
/// So many of the best values there, per effect and place, are then compared on all samples.
const FINALISTS: usize = 4;

/// An effect with a value of its constant in a place and a form.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Variant {
    /// Value of the constant; `None` where it has none or it is not searched.
    pub value: Option<f64>,
    pub placement: Placement,
}

/// The best variant of an effect, and the factor by which p-values are to be multiplied for the number of variants.
struct BestVariant {
    pub variant: Variant,
    pub correction: f64,
}

/// Variants of one of several effects, by its number, with their score statistics.
type Scored = (usize, Variant, f64);

/// Tests variants of `effects`, each given with the number of its effect, and hands each linearisation with the tested ones to
/// `read`.
fn test<F: Fit, T: Send>(
    fit: &F,
    register: &Register,
    effects: &[Effect],
    variants: &[(usize, Variant)],
    read: impl Fn(&Linearization, &[(usize, Variant)]) -> Vec<T> + Sync,
) -> Result<Vec<T>, F::Error> {
    let chunks: Result<Vec<Vec<T>>, F::Error> = variants
        .par_chunks(VARIANTS_PER_LINEARIZATION)
        .map(|chunk| {
            let candidate = |(i, v): &(usize, Variant)| {
                CandidateBlock::effect(register, effects[*i].spec(v.value, v.placement)).map(|c| ((*i, *v), c))
            };
            let (tested, candidates): (Vec<_>, Vec<_>) = chunk.iter().filter_map(candidate).unzip();
            Ok(read(&fit.linearize(&candidates)?, &tested))
        })
        .collect();
    Ok(chunks?.into_iter().flatten().collect())
}

/// Score statistics of variants.
fn scored<F: Fit>(
    fit: &F,
    register: &Register,
    effects: &[Effect],
    variants: &[(usize, Variant)],
) -> Result<Vec<Scored>, F::Error> {
    test(fit, register, effects, variants, |linearization, tested| {
        tested.iter().enumerate().map(|(k, (i, v))| (*i, *v, linearization.score(k).statistic)).collect()
    })
}

/// The variant of effect `i` with the largest statistic among those that `select` accepts; of equals the first.
fn best(scores: &[Scored], i: usize, select: impl Fn(&Variant) -> bool) -> Option<(Variant, f64)> {
    let of_effect = scores.iter().filter(|(k, v, _)| *k == i && select(v)).map(|(_, v, s)| (*v, *s));
    of_effect.reduce(|a, b| if b.1 > a.1 { b } else { a })
}

/// The [`FINALISTS`] best of the variants of every effect in every place and form.
fn finalists(mut scores: Vec<Scored>) -> Vec<(usize, Variant)> {
    scores.sort_by(|a, b| b.2.total_cmp(&a.2));
    let mut chosen: Vec<(usize, Variant)> = Vec::new();
    for (i, variant, _) in scores {
        let rivals = chosen.iter().filter(|(k, v)| *k == i && v.placement == variant.placement).count();
        if rivals < FINALISTS {
            chosen.push((i, variant));
        }
    }
    chosen
}

/// The variant with the largest score statistic of every effect; `None` for those that cannot be tested.
///
/// # Errors
///
/// That of the fit where its problem cannot be evaluated.
fn best_variants<F: Fit>(
    fit: &F,
    register: &Register,
    effects: &[Effect],
    thresholds: &Thresholds,
) -> Result<Vec<Option<BestVariant>>, F::Error> {
    // Its own form with all values of its constant, in both places where that makes a difference.
    let coarse = effects.iter().enumerate().flat_map(|(i, effect)| {
        let values =
            if effect.values.is_empty() { vec![None] } else { effect.values.iter().copied().map(Some).collect() };
        let places = if effect.shifts { &effect.placements[..] } else { &effect.placements[..1] };
        let own_form: Vec<Placement> = places.iter().copied().filter(|p| p.on.is_none()).collect();
        own_form
            .into_iter()
            .flat_map(move |placement| values.clone().into_iter().map(move |value| (i, Variant { value, placement })))
    });
    let (many, few): (Vec<_>, Vec<_>) = coarse.partition(|(i, _)| effects[*i].values.len() >= MANY_VALUES);
    let finalists = finalists(scored(&fit.thinned(SAMPLE_STEP), register, effects, &many)?);
    let mut scores = scored(fit, register, effects, &[few, finalists].concat())?;
    // All places and forms with the best value of the place.
    let forms = effects.iter().enumerate().flat_map(|(i, effect)| {
        let of_place = |of: Of| best(&scores, i, |v| v.placement.of == of).or_else(|| best(&scores, i, |_| true));
        let variant = |placement: &Placement| Some((i, Variant { placement: *placement, ..of_place(placement.of)?.0 }));
        effect.placements.iter().filter_map(variant).collect::<Vec<_>>()
    });
    let forms: Vec<_> = forms.filter(|new| !scores.iter().any(|(i, v, _)| (*i, *v) == *new)).collect();
    scores.extend(scored(fit, register, effects, &forms)?);
    // Finer values in the best place and form.
    let fine = effects.iter().enumerate().filter(|(_, effect)| effect.refine).flat_map(|(i, effect)| {
        let best_variant = best(&scores, i, |_| true).map(|(v, _)| v);
        let value = best_variant.and_then(|v| v.value).filter(|v| v.is_finite());
        let values = value.map_or_else(Vec::new, |value| finer(&effect.values, value));
        best_variant
            .into_iter()
            .flat_map(move |v| values.clone().into_iter().map(move |x| (i, Variant { value: Some(x), ..v })))
    });
    let fine: Vec<_> = fine.collect();
    scores.extend(scored(fit, register, effects, &fine)?);
    let chosen = effects.iter().enumerate().map(|(i, effect)| {
        let (variant, _) = best(&scores, i, |_| true)?;
        let variants = (effect.values.len().max(1) * effect.placements.len()) as f64;
        Some(BestVariant { variant, correction: (variants / thresholds.values_per_test).max(1.0) })
    });
    Ok(chosen.collect())
}

/// A candidate for every effect in its best variant, with the factor by which its p-value is to be multiplied for the number of
/// variants. Effects that cannot be tested are left out.
///
/// # Errors
///
/// That of the fit where its problem cannot be evaluated.
pub(super) fn best_candidates<F: Fit>(
    fit: &F,
    register: &Register,
    effects: &[Effect],
    thresholds: &Thresholds,
) -> Result<Vec<(CandidateBlock, f64)>, F::Error> {
    let best = best_variants(fit, register, effects, thresholds)?;
    let candidate = |(effect, best): (&Effect, Option<BestVariant>)| {
        let BestVariant { variant, correction } = best?;
        let candidate = CandidateBlock::effect(register, effect.spec(variant.value, variant.placement))?;
        Some((CandidateBlock { value: variant.value, ..candidate }, correction))
    };
    Ok(effects.iter().zip(best).filter_map(candidate).collect())
}

/// An effect that was added, as a search jointly with everything else that `fit` has finds it.
pub(super) struct Refined {
    /// Its evidence with a better value of its constant, a better place or a better form.
    pub evidence: Evidence,
    /// The places and forms that these captures cannot tell from it.
    pub rivals: Vec<Placement>,
}

/// Searches constant, place and form of an effect that was added; `None` where nothing of it is searched, or where parameters of
/// the effect are held. Its own equation's place and form are taken where they cannot be told from the best and explain
/// nearly as much.
pub(super) fn refined_variant(
    fit: &CalibratedCamera,
    register: &Register,
    added: &Evidence,
    thresholds: &Thresholds,
) -> Option<Refined> {
    if added.reduced.as_ref() == Some(&added.spec) {
        return None;
    }
    let without = CalibratedCamera { camera: fit.camera.filtered(|b| b.name() != added.name), ..fit.clone() };
    let states = ObservedStates::of(fit);
    let effect = missing_effects(register, &without, &states).into_iter().find(|e| e.name == added.name)?;
    let effects = std::slice::from_ref(&effect);
    let values: Vec<Option<f64>> = match added.value {
        _ if !effect.afterwards.is_empty() => effect.afterwards.iter().copied().map(Some).collect(),
        Some(value) if effect.refine && value.is_finite() => {
            around(value, &effect.values).into_iter().map(Some).collect()
        }
        value => vec![value],
    };
    if values.len() < 2 && effect.placements.len() < 2 {
        return None;
    }
    let own_form = effect.placements.iter().copied().filter(|p| p.on.is_none() || *p == added.spec.placement);
    let first =
        own_form.flat_map(|placement| values.iter().map(move |value| (0, Variant { value: *value, placement })));
    let mut scores = scored(&without, register, effects, &first.collect::<Vec<_>>()).ok()?;
    let of_place = |of: Of| best(&scores, 0, |v| v.placement.of == of);
    // The few values that are searched afterwards only are searched in every form: a wrong one may decide between forms.
    let forms = effect.placements.iter().flat_map(|placement| {
        let values_of_place = of_place(placement.of).into_iter().map(|(v, _)| v.value);
        let values: Vec<_> = if effect.afterwards.is_empty() { values_of_place.collect() } else { values.clone() };
        values.into_iter().map(|value| (0, Variant { value, placement: *placement }))
    });
    let forms: Vec<_> = forms.filter(|(_, new)| !scores.iter().any(|(_, v, _)| v == new)).collect();
    scores.extend(scored(&without, register, effects, &forms).ok()?);
    let of_placement = |p: &Placement| best(&scores, 0, |v| v.placement == *p);
    let finals: Vec<(usize, Variant)> =
        effect.placements.iter().filter_map(of_placement).map(|(v, _)| (0, v)).collect();
    // A frame that decides alone decides nothing: places are told apart by gains on left-out frames.
    let gains = test(&without, register, effects, &finals, |linearization, tested| {
        tested.iter().enumerate().map(|(k, (_, v))| (*v, linearization.held_out_gain(&[k]))).collect()
    });
    let gains: Vec<(Variant, Vec<f64>)> = gains.ok()?;
    let (top, most) = best(&scores, 0, |_| true)?;
    let of_top = &gains.iter().find(|(v, _)| *v == top)?.1;
    // What an effect of a slightly other shape leaves can decide with certainty about so little.
    let explains_as_much = |v: &Variant| {
        let statistic = of_placement(&v.placement).map_or(0.0, |(_, statistic)| statistic);
        most - statistic < thresholds.least_placement_gain * most
    };
    let is_rival = |v: &Variant, own: &[f64]| {
        explains_as_much(v) || mean_to_standard_error(&difference(of_top, own)) < thresholds.distinguishing_t
    };
    let tied: Vec<Variant> = gains.iter().filter(|(v, own)| is_rival(v, own)).map(|(v, _)| *v).collect();
    let default_form = tied.iter().copied().find(|v| v.placement == Placement::default() && explains_as_much(v));
    let chosen = default_form.unwrap_or(top);
    let rivals = tied.iter().map(|v| v.placement).filter(|p| *p != chosen.placement).collect();
    let spec = effect.spec(chosen.value, chosen.placement);
    Some(Refined { evidence: Evidence { spec, value: chosen.value, ..added.clone() }, rivals })
}
