//! The functions that the residuals of a model depend on, found together and fitted, without names.

use depthcal_model::PieceSpec;
use tracing::info;

use super::augmented_model::AugmentedModel;
use super::bench::{Bench, Fitted};
use super::formula::evidence_of;
use crate::calibrate::CalibratedCamera;
use crate::diagnose::added_effect::AddedEffect;
use crate::diagnose::discovery::{Component, Discovery, effects_of_board};
use crate::diagnose::held_out::Gain;
use crate::diagnose::merit::significant;
use crate::judge::cross_validation::weighted_gain_percent;

/// A model and its fit.
pub(super) type Model = (AugmentedModel, Fitted);

/// Where an explanation starts, and the model that it has to be better than.
#[derive(Clone, Copy)]
pub(super) struct Task<'a> {
    /// The model whose residuals are explained.
    pub model: &'a AugmentedModel,
    pub base: &'a Fitted,
    pub incumbent: &'a Fitted,
    /// The number of its effects that were there before.
    pub before: usize,
}

/// Searches with the noise that the functions of the last one leave: what is missing counts as noise before.
const SEARCHES: usize = 4;

/// The model of a task with the functions that its residuals depend on, and the share of the squared residuals that each
/// explains. They are searched again with the noise that they leave as long as the held-out errors fall, and given those that
/// were found, which are fitted better than a search can.
pub(super) fn functions(bench: &impl Bench, task: &Task<'_>) -> Option<(Model, Vec<f64>)> {
    let Task { model, base, incumbent, .. } = task;
    let is_quieter = noise_ratio(&base.fit, &incumbent.fit) < 1.0;
    let mut noise = if is_quieter { base.fit.noise } else { incumbent.fit.noise };
    let mut described: Option<(Model, Vec<f64>)> = None;
    let mut last_definitions = Vec::new();
    for _ in 0..SEARCHES {
        let fit = CalibratedCamera { noise, ..base.fit.clone() };
        let components = components(bench, model, &fit);
        let definitions = components.iter().map(|c| c.description.effect.definition().clone()).collect();
        // The same functions would be fitted as before.
        let is_new = std::mem::replace(&mut last_definitions, definitions) != last_definitions;
        let searched = if is_new { with_components(bench, model, base, components) } else { None }
            .map(|(with, shares)| (with_effects_of_board(bench, with), shares));
        let better = searched.filter(|((_, with), _)| described.as_ref().is_none_or(|((_, b), _)| falls(b, with)));
        let next = match (better, &described) {
            (Some(better), _) => better,
            (None, Some(before)) => match more_functions(bench, task, before) {
                Some(more) => more,
                None => break,
            },
            (None, None) => break,
        };
        noise = next.0.1.fit.noise;
        described = Some(next);
    }
    described
}

/// The functions of a task with those that a fit with them leaves, where the held-out errors fall for certain with these.
fn more_functions(
    bench: &impl Bench,
    task: &Task<'_>,
    ((model, fitted), shares): &(Model, Vec<f64>),
) -> Option<(Model, Vec<f64>)> {
    let before = model.added.len();
    let components = components(bench, model, &fitted.fit);
    let ((with, better), more) = with_components(bench, model, fitted, components)?;
    if !matches!(better.gain_over(fitted, &with.added[before..], bench.thresholds()), Gain::Certain(_)) {
        return None;
    }
    // Effects of the board stand after the functions: they have no share.
    let mut shares = shares.clone();
    shares.resize(before - task.model.added.len(), 0.0);
    let of_all = noise_ratio(&fitted.fit, &task.incumbent.fit).powi(2);
    shares.extend(more.into_iter().map(|share| of_all * share));
    Some(((with, better), shares))
}

/// The functions that a fit of a model leaves.
fn components(bench: &impl Bench, model: &AugmentedModel, fit: &CalibratedCamera) -> Vec<Component> {
    bench.report("searching what the residuals depend on", &model.options(bench.declared()));
    bench.components(fit, &model.names(fit))
}

/// A model with functions that a fit leaves, and the share of its squared residuals that each explains; `base` is the model
/// without them. `None` where there are none, or where they cannot be fitted.
fn with_components(
    bench: &impl Bench,
    model: &AugmentedModel,
    base: &Fitted,
    components: Vec<Component>,
) -> Option<(Model, Vec<f64>)> {
    if components.is_empty() {
        return None;
    }
    let shares = components.iter().map(|component| component.share).collect();
    let functions = components.into_iter().map(|component| component.description);
    with_functions(bench, model, base, functions).map(|with| (with, shares))
}

/// Whether the held-out error falls by more than next to nothing.
fn falls(before: &Fitted, after: &Fitted) -> bool {
    lower_percent(before, after).is_some_and(|percent| percent >= LEAST_FALL)
}

/// Ratio of the noise of a fit to that of another.
fn noise_ratio(fit: &CalibratedCamera, other: &CalibratedCamera) -> f64 {
    let [noise, of_other] = [fit, other].map(|fit| fit.noise.depth.sigma(TYPICAL_INVERSE_DEPTH));
    noise / of_other
}

/// Inverse depth at which noise is compared, 1/mm.
const TYPICAL_INVERSE_DEPTH: f64 = 1e-3;
/// Least fall of the held-out error by a further search, per cent.
const LEAST_FALL: f64 = 0.5;

/// Fall of the held-out error of depth from one model to another, per cent, weighted by the noise of the latter.
pub(super) fn lower_percent(before: &Fitted, after: &Fitted) -> Option<f64> {
    let [b, a] = [before, after].map(|fitted| &fitted.held_out.evaluated);
    weighted_gain_percent(b, a, &after.fit.noise.depth).map(|gain| gain.value)
}

/// The model with some functions, fitted together; `None` where it cannot be fitted.
pub(super) fn with_functions(
    bench: &impl Bench,
    model: &AugmentedModel,
    present: &Fitted,
    functions: impl IntoIterator<Item = Discovery>,
) -> Option<Model> {
    let mut with = model.clone();
    for function in functions {
        let spec = function.effect.spec();
        with.formulas.push(function);
        let register = with.register(bench.declared());
        let evidence = evidence_of(bench, &present.fit, &register, spec)?;
        with = with.with(AddedEffect::alone(evidence, 0.0, present.held_out.clone()));
    }
    match bench.fitted(&with.options(bench.declared())) {
        Ok(fitted) => Some((with, fitted)),
        Err(error) => {
            info!("additive: the functions cannot be fitted together: {error}");
            None
        }
    }
}

/// The model with those effects of the board that lower the held-out errors for certain: a bent board hides functions of depth,
/// as these hide its shape.
fn with_effects_of_board(bench: &impl Bench, (mut model, mut fitted): Model) -> Model {
    let names: Vec<&str> = effects_of_board(&bench.declared().register, &fitted.fit.camera).collect();
    for name in names {
        let register = model.register(bench.declared());
        let evidence = evidence_of(bench, &fitted.fit, &register, PieceSpec::new(name));
        let Some(evidence) = evidence.filter(|e| significant(e.p_value, 1, &e.gains, bench.thresholds())) else {
            continue;
        };
        let p_value = evidence.p_value;
        let with = model.clone().with(AddedEffect::alone(evidence, p_value, fitted.held_out.clone()));
        let bent = match bench.fitted(&with.options(bench.declared())) {
            Ok(bent) => bent,
            Err(error) => {
                info!("additive: with {name}: {error}");
                continue;
            }
        };
        if matches!(bent.gain_over(&fitted, &with.added[model.added.len()..], bench.thresholds()), Gain::Certain(_)) {
            (model, fitted) = (with, bent);
        }
    }
    (model, fitted)
}
