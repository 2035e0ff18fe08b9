//! Several effects at once: functions first, names second.
//!
//! Two effects can hide each other where each is tried alone. So all functions on which the residuals depend are found together,
//! without names, and fitted. Then each is explained given all others, as a single missing effect would be: by an effect of the
//! catalogue, by a formula, or by nothing. A function that nothing explains stays as the correction that it is.

use depthcal_model::{Block, PieceSpec};
use tracing::info;

use super::augmented_model::AugmentedModel;
use super::bench::{Bench, Fitted};
use super::decided::{Decided, decided};
use super::formula::{evidence_of, with_formula};
use super::lost_gain::{has_covariates_of, lost, says_as_much};
use super::proposal::Proposal;
use super::revisit::{Revisited, without_needless};
use super::state::{Accepted, Event, Memory, State};
use super::trial::tried;
use crate::adjust::blocks::is_depth_only;
use crate::calibrate::{CalibrateError, CalibratedCamera};
use crate::diagnose::added_effect::AddedEffect;
use crate::diagnose::decision::Decision;
use crate::diagnose::discovery::{Component, Search, effects_of_board};
use crate::diagnose::error::DiagnoseError;
use crate::diagnose::examination::Examination;
use crate::diagnose::held_out::Gain;
use crate::diagnose::merit::{merit, significant};
use crate::diagnose::round::RoundOutcome;
use crate::judge::cross_validation::weighted_gain_percent;

/// A model and its fit.
type Model = (AugmentedModel, Fitted);

/// Where an explanation starts, and the model that it has to be better than.
struct Task<'a> {
    /// The model whose residuals are explained.
    model: &'a AugmentedModel,
    base: &'a Fitted,
    incumbent: &'a Fitted,
}

/// Searches with the noise that the functions of the last one leave: what is missing counts as noise before.
const SEARCHES: usize = 4;

/// The present model with explanations of all functions that its residuals depend on, where the held-out errors fall for certain
/// with them.
///
/// # Errors
///
/// [`DiagnoseError`] where models along the way cannot be fitted or examined.
pub(super) fn explained_together(
    bench: &impl Bench,
    state: &State,
    examination: &Examination,
) -> Result<Event, DiagnoseError> {
    let State { model, present, .. } = state;
    let task = Task { model, base: present, incumbent: present };
    let with = match functions(bench, &task)? {
        None => None,
        Some(described) => match one_effect(bench, state, examination)? {
            Some(alone) if says_all(present, &described.0.1, &alone.present) => Some(alone),
            // Where the functions do not help, the effect does, which the next trial would find again.
            alone => explained(bench, state, examination, &task, described)?.or(alone),
        },
    };
    Ok(Event::ExplainedTogether(with))
}

/// The present model with the one effect that the residuals decide for, where it helps.
fn one_effect(
    bench: &impl Bench,
    state: &State,
    examination: &Examination,
) -> Result<Option<Box<Accepted>>, DiagnoseError> {
    let State { present, memory, .. } = state;
    let Decided { decision, .. } = decided(&present.fit, examination, memory, bench.options())?;
    let Decision::Add { effect, indistinguishable, .. } = &decision else { return Ok(None) };
    let proposal = Proposal { effect: *effect, jointly_with: &[], indistinguishable };
    let event = tried(bench, state, examination, proposal)?;
    Ok(if let Event::Accepted(accepted) = event { Some(accepted) } else { None })
}

/// Whether one effect says as much as all functions together: they are its parts.
fn says_all(without: &Fitted, functions: &Fitted, effect: &Fitted) -> bool {
    lost(without, functions, effect).is_some_and(|lost| lost.is_little())
}

/// The model with all effects of depth explained anew, together, where the held-out errors are lower for certain: effects that
/// were added one after the other may have taken up parts of each other.
///
/// # Errors
///
/// [`DiagnoseError`] where models along the way cannot be fitted or examined.
pub(super) fn explained_anew(
    bench: &impl Bench,
    state: &State,
    examination: &Examination,
) -> Result<Option<Box<Accepted>>, DiagnoseError> {
    let State { model, present, .. } = state;
    let without = model.without_depth_effects();
    // Names that explain most took up no part of others, nor did a single effect that leaves nothing.
    let largest = model.added.iter().max_by(|a, b| merit(&a.evidence).total_cmp(&merit(&b.evidence)));
    let is_described =
        largest.is_some_and(|effect| model.formulas.iter().any(|f| f.effect.name() == effect.evidence.name));
    let effects = model.added.len() - without.added.len();
    if !is_described || effects == 0 || effects == 1 && state.findings.left_over.is_empty() {
        return Ok(None);
    }
    let base = if without.added.is_empty() {
        state.first.clone()
    } else {
        match bench.fitted(&without.options(bench.declared())) {
            Ok(base) => base,
            Err(error) => {
                info!("additive: without effects of depth: {error}");
                return Ok(None);
            }
        }
    };
    let task = Task { model: &without, base: &base, incumbent: present };
    let Some(described) = functions(bench, &task)? else { return Ok(None) };
    let explained = explained(bench, state, examination, &task, described)?;
    // Without what was needless it may be the present model again.
    let is_better = |anew: &Accepted| {
        let added = anew.model.added.get(without.added.len()..).unwrap_or_default();
        matches!(anew.present.gain_over(present, added, bench.thresholds()), Gain::Certain(_))
    };
    Ok(explained.filter(|anew| is_better(anew)))
}

/// The model with the functions of a task explained, where the held-out errors fall for certain with them.
fn explained(
    bench: &impl Bench,
    state: &State,
    examination: &Examination,
    task: &Task<'_>,
    (mut described, shares): (Model, Vec<f64>),
) -> Result<Option<Box<Accepted>>, DiagnoseError> {
    let before = task.model.added.len();
    let gain = described.1.gain_over(task.incumbent, &described.0.added[before..], bench.thresholds());
    if !matches!(gain, Gain::Certain(_)) {
        let percent = lower_percent(task.incumbent, &described.1).unwrap_or(f64::NAN);
        info!("additive: the errors on left-out frames fall by {percent:.2} %, not for certain");
        return Ok(None);
    }
    let explained = (before..).zip(&shares).filter(|(_, share)| **share >= LEAST_NAMED);
    // With the number of names when the function was last tried in vain: once another has a name, it may be explained.
    let mut functions: Vec<(usize, Option<usize>)> = explained.map(|(place, _)| (place, None)).collect();
    let (mut names, mut refuted) = (0, Vec::new());
    for _ in 0..NAMING_PASSES {
        let mut without_name = Vec::new();
        for (place, tried) in functions {
            if tried == Some(names) {
                continue;
            }
            match named(bench, &state.memory, &described, place)? {
                Naming::Named(named) => (described, names) = (*named, names + 1),
                Naming::Refuted => refuted.push(place),
                Naming::Nothing => without_name.push((place, Some(names))),
            }
        }
        functions = without_name;
    }
    let (mut model, mut fitted) = described;
    if !refuted.is_empty() {
        refuted.sort_unstable();
        model = refuted.into_iter().rev().fold(model, |model, place| model.without(place));
        fitted = bench.fitted(&model.options(bench.declared()))?;
        if !matches!(fitted.gain_over(task.incumbent, &model.added[before..], bench.thresholds()), Gain::Certain(_)) {
            return Ok(None);
        }
    }
    let Revisited { model, present, removed, earlier } =
        without_needless(bench, model, fitted, before, false, examination.tests)?;
    let effects = model.specs_from(earlier);
    if effects.is_empty() {
        return Ok(None);
    }
    let share = |effect: &AddedEffect| merit(&effect.evidence) / examination.cost();
    let largest_share = model.added[earlier..].iter().map(share).fold(state.memory.largest_share, f64::max);
    let outcome = Some(RoundOutcome::Explained { effects, removed });
    Ok(Some(Box::new(Accepted { model, present, largest_share, outcome })))
}

/// The model of a task with the functions that its residuals depend on, and the share of the squared residuals that each
/// explains. They are searched again with the noise that they leave as long as the held-out errors fall, and given those that
/// were found, which are fitted better than a search can.
fn functions(bench: &impl Bench, task: &Task<'_>) -> Result<Option<(Model, Vec<f64>)>, CalibrateError> {
    let Task { model, base, incumbent } = task;
    bench.report("searching what the residuals depend on", &model.options(bench.declared()));
    let mut noise = incumbent.fit.noise;
    let mut described: Option<(Model, Vec<f64>)> = None;
    for _ in 0..SEARCHES {
        let fit = CalibratedCamera { noise, ..base.fit.clone() };
        let searched = match functions_left(bench, (model, &fit), base)? {
            Some((with, shares)) => Some((with_effects_of_board(bench, with)?, shares)),
            None => None,
        };
        let better = searched.filter(|((_, with), _)| described.as_ref().is_none_or(|((_, b), _)| falls(b, with)));
        let next = match (better, &described) {
            (Some(better), _) => better,
            (None, Some(before)) => match more_functions(bench, task, before)? {
                Some(more) => more,
                None => break,
            },
            (None, None) => break,
        };
        noise = next.0.1.fit.noise;
        described = Some(next);
    }
    Ok(described)
}

/// The functions of a task with those that a fit with them leaves, where the held-out errors fall for certain with these.
fn more_functions(
    bench: &impl Bench,
    task: &Task<'_>,
    ((model, fitted), shares): &(Model, Vec<f64>),
) -> Result<Option<(Model, Vec<f64>)>, CalibrateError> {
    let before = model.added.len();
    let Some(((with, better), more)) = functions_left(bench, (model, &fitted.fit), fitted)? else { return Ok(None) };
    if !matches!(better.gain_over(fitted, &with.added[before..], bench.thresholds()), Gain::Certain(_)) {
        return Ok(None);
    }
    // Effects of the board stand after the functions: they have no share.
    let mut shares = shares.clone();
    shares.resize(before - task.model.added.len(), 0.0);
    let of_all = noise_ratio(&fitted.fit, &task.incumbent.fit).powi(2);
    shares.extend(more.into_iter().map(|share| of_all * share));
    Ok(Some(((with, better), shares)))
}

/// A model with the functions that a fit of it leaves, and the share of its squared residuals that each explains; `base` is the
/// model without them. `None` where there are none, or where they cannot be fitted.
fn functions_left(
    bench: &impl Bench,
    (model, fit): (&AugmentedModel, &CalibratedCamera),
    base: &Fitted,
) -> Result<Option<(Model, Vec<f64>)>, CalibrateError> {
    let components = bench.components(fit, &model.names(&base.fit));
    if components.is_empty() {
        return Ok(None);
    }
    let shares = components.iter().map(|component| component.share).collect();
    Ok(with_descriptions(bench, model, base, components)?.map(|with| (with, shares)))
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
/// Share of the squared residuals that a function explains, from which on it is explained: names of less would be chance.
const LEAST_NAMED: f64 = 0.02;
/// Passes in which names are looked for, and effects of the catalogue that are tried for a function in each.
const NAMING_PASSES: usize = 2;
const MOST_NAMES: usize = 2;
/// Least fall of the held-out error by a further search, per cent.
const LEAST_FALL: f64 = 0.5;

/// Fall of the held-out error of depth from one model to another, per cent, weighted by the noise of the latter.
fn lower_percent(before: &Fitted, after: &Fitted) -> Option<f64> {
    let [b, a] = [before, after].map(|fitted| &fitted.held_out.evaluated);
    weighted_gain_percent(b, a, &after.fit.noise.depth).map(|gain| gain.value)
}

/// The model with the formulas that describe some components, fitted together; `None` where it cannot be fitted.
fn with_descriptions(
    bench: &impl Bench,
    model: &AugmentedModel,
    present: &Fitted,
    components: Vec<Component>,
) -> Result<Option<Model>, CalibrateError> {
    let mut with = model.clone();
    for Component { description, .. } in components {
        let spec = description.effect.spec();
        with.formulas.push(description);
        let register = with.register(bench.declared());
        let Some(evidence) = evidence_of(bench, &present.fit, &register, spec) else { return Ok(None) };
        with = with.with(AddedEffect::alone(evidence, 0.0, present.held_out.clone()));
    }
    match bench.fitted(&with.options(bench.declared())) {
        Ok(fitted) => Ok(Some((with, fitted))),
        Err(error) => {
            info!("additive: the functions cannot be fitted together: {error}");
            Ok(None)
        }
    }
}

/// The model with those effects of the board that lower the held-out errors for certain: a bent board hides functions of depth,
/// as these hide its shape.
fn with_effects_of_board(bench: &impl Bench, (mut model, mut fitted): Model) -> Result<Model, CalibrateError> {
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
    Ok((model, fitted))
}

/// Outcome of naming a function.
enum Naming {
    /// An effect or a formula that explains as much takes its place.
    Named(Box<Model>),
    /// Frames that the search has not seen do not have it.
    Refuted,
    /// Nothing explains as much.
    Nothing,
}

/// The model with an effect or a formula in the place of the function number `place`, given all others.
fn named(bench: &impl Bench, memory: &Memory, with: &Model, place: usize) -> Result<Naming, DiagnoseError> {
    let (model, fitted) = with;
    let without = model.without(place);
    let reduced = match bench.fitted(&without.options(bench.declared())) {
        Ok(reduced) => reduced,
        Err(error) => {
            info!("additive: without {}: {error}", model.added[place].evidence.spec);
            return Ok(Naming::Nothing);
        }
    };
    // What is missing is no noise.
    let reduced = Fitted { fit: CalibratedCamera { noise: fitted.fit.noise, ..reduced.fit }, ..reduced };
    bench.report("explaining a function of what is left", &without.options(bench.declared()));
    let examination = bench.examine(&reduced.fit)?;
    let function = model.formulas.iter().find(|f| f.effect.name() == model.added[place].evidence.name);
    let is_own = |block: &Block| function.is_some_and(|function| has_covariates_of(block, function));
    let mut tried = Memory { hidden: memory.hidden.clone(), ..Memory::default() };
    for _ in 0..MOST_NAMES {
        let Decided { decision, .. } = decided(&reduced.fit, &examination, &tried, bench.options())?;
        let Decision::Add { effect, indistinguishable, .. } = &decision else { break };
        let proposal = Proposal { effect: *effect, jointly_with: &[], indistinguishable };
        let effect = proposal.effects(&examination, &reduced.held_out).swap_remove(0);
        let name = effect.evidence.spec.to_string();
        tried.tried.rejected.push(effect.evidence.name.clone());
        // A function of depth is explained by an effect of depth.
        if !is_depth_only(&effect.evidence.block) {
            continue;
        }
        let is_own = is_own(&effect.evidence.block);
        match bench.refined(without.clone().with(effect)) {
            Ok((model, named)) if says_as_much(&reduced, fitted, &named, (&name, is_own)) => {
                return Ok(Naming::Named(Box::new((in_place(model, place), named))));
            }
            Ok(_) => {}
            Err(error) => info!("additive: {name}: {error}"),
        }
    }
    let Some(function) = function else { return Ok(Naming::Nothing) };
    let taken = without.names(&reduced.fit);
    let Search::Found(discovery) = bench.formula_of(&function.covariates, &reduced.fit, &examination, &taken) else {
        return Ok(Naming::Nothing);
    };
    if discovery.is_refuted() {
        info!("additive: frames that the search has not seen do not have {}", discovery.effect.text());
        return Ok(Naming::Refuted);
    }
    let name = discovery.effect.text();
    let formula = with_formula(bench, &without, &reduced, *discovery);
    let formula = formula.filter(|(_, named)| says_as_much(&reduced, fitted, named, (&name, true)));
    Ok(formula.map_or(Naming::Nothing, |(model, named)| Naming::Named(Box::new((in_place(model, place), named)))))
}

/// The model with its last effect at number `place`.
fn in_place(mut model: AugmentedModel, place: usize) -> AugmentedModel {
    if let Some(last) = model.added.pop() {
        model.added.insert(place, last);
    }
    model
}

#[cfg(test)]
mod tests {
    use super::super::linear_bench::{FORMULA, FUNCTIONS, LinearBench, regressor, sum};
    use super::*;
    use crate::diagnose::left_over::LeftOver;
    use crate::diagnose::linear_examination::{Planted, examined};

    /// Name of a function that is the mean of the two.
    const IMITATION: &str = "found_r_z";

    /// Two functions of given sizes that share most of what they explain, one that is their mean, an effect
    /// that is each of them, and a formula that is the first.
    fn bench(sizes: [f64; 2]) -> LinearBench {
        let common = regressor(1);
        let [first, second] = [2, 3].map(|seed| sum(&[(1.0, &common), (0.5, &regressor(seed))]));
        let between = sum(&[(0.5, &first), (0.5, &second)]);
        let mut bench = LinearBench::new(&[
            (FUNCTIONS[0], sizes[0], first.clone()),
            (FUNCTIONS[1], sizes[1], second.clone()),
            (IMITATION, 0.0, between),
            ("range_offset", 0.0, first.clone()),
            ("radial_range", 0.0, second),
            (FORMULA, 0.0, first),
        ]);
        bench.functions = FUNCTIONS.to_vec();
        bench
    }

    /// The model with functions explained.
    fn together(bench: &LinearBench, state: &State) -> Option<Box<Accepted>> {
        match explained_together(bench, state, &examined(Planted::default(), 1)).unwrap() {
            Event::ExplainedTogether(with) => with,
            _ => panic!("another event"),
        }
    }

    fn names(accepted: &Accepted) -> Vec<&str> {
        accepted.model.added.iter().map(|effect| effect.evidence.name.as_str()).collect()
    }

    #[test]
    fn functions_that_hide_each_other_are_added_together() {
        let bench = bench([0.6, -0.6]);
        let state = bench.state(&[]);
        let accepted = together(&bench, &state).unwrap();
        assert_eq!(names(&accepted), FUNCTIONS.to_vec());
        assert_eq!(accepted.model.formulas.len(), 2);
        assert!(matches!(accepted.outcome, Some(RoundOutcome::Explained { ref effects, .. }) if effects.len() == 2));
    }

    #[test]
    fn functions_that_do_not_help_are_not_added() {
        let bench = bench([0.0, 0.0]);
        assert!(together(&bench, &bench.state(&[])).is_none());
    }

    /// One of the two explains nothing that the other does not.
    #[test]
    fn a_needless_function_is_removed() {
        let bench = bench([0.6, 0.0]);
        let accepted = together(&bench, &bench.state(&[])).unwrap();
        assert_eq!(names(&accepted), FUNCTIONS[..1]);
    }

    #[test]
    fn a_formula_that_says_as_much_takes_the_place_of_its_function() {
        let mut bench = bench([0.6, -0.6]);
        bench.finds_formula = true;
        let accepted = together(&bench, &bench.state(&[])).unwrap();
        assert_eq!(names(&accepted), [FORMULA, FUNCTIONS[1]]);
    }

    #[test]
    fn effects_that_took_up_parts_of_each_other_are_explained_anew() {
        let mut bench = bench([0.9, -0.3]);
        let examination = examined(Planted::default(), 1);
        let state = bench.state(&["range_offset", "radial_range"]);
        let accepted = explained_anew(&bench, &state, &examination).unwrap();
        assert!(accepted.is_none(), "the two explain as much");
        // One function that imitates both was found first.
        bench.functions = vec![IMITATION];
        let mut state = bench.state(&[]);
        let with = together(&bench, &state);
        assert_eq!(names(with.as_ref().unwrap()), [IMITATION]);
        state.apply(Event::ExplainedTogether(with));
        assert!(explained_anew(&bench, &state, &examination).unwrap().is_none(), "a single effect, nothing left");
        bench.functions = FUNCTIONS.to_vec();
        state.findings.left_over.push(LeftOver::FramePlanes { share: 0.5, rms_mm: 1.0 });
        let accepted = explained_anew(&bench, &state, &examination).unwrap().unwrap();
        assert_eq!(names(&accepted), FUNCTIONS);
    }
}
