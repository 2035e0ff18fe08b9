//! Several effects at once: functions first, names second.
//!
//! Two effects can hide each other where each is tried alone. So all functions on which the residuals depend are found together,
//! without names, and fitted. Then each is explained given all others, as a single missing effect would be: by an effect of the
//! catalogue, by a formula, or by nothing. A function that nothing explains stays as the correction that it is.

use tracing::info;

use super::bench::{Bench, Fitted};
use super::decided::{Decided, decided};
use super::functions::{Model, Task, functions, lower_percent};
use super::lost_gain::lost;
use super::naming::{Naming, named};
use super::proposal::Proposal;
use super::revisit::{Revisited, without_needless};
use super::state::{Accepted, Event, Memory, State};
use super::trial::{fitted_with, tried};
use crate::diagnose::added_effect::AddedEffect;
use crate::diagnose::decision::Decision;
use crate::diagnose::error::DiagnoseError;
use crate::diagnose::examination::Examination;
use crate::diagnose::held_out::Gain;
use crate::diagnose::merit::merit;
use crate::diagnose::round::RoundOutcome;

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
    let task = Task { model, base: present, incumbent: present, before: model.added.len() };
    let with = match functions(bench, &task) {
        None => None,
        Some(described) => match one_effect(bench, state, examination)? {
            None => explained(bench, state, examination, &task, described)?,
            Some(alone) if says_all(present, &described.0.1, &alone.present) => Some(alone),
            Some(alone) => {
                // It may have made some of those before it needless.
                let before = task.before.min(alone.model.added.len().saturating_sub(1));
                let anew = Task { model: &alone.model, base: &alone.present, before, ..task };
                match given(bench, state, examination, &anew, &described.0)? {
                    Some(better) => Some(better),
                    // Where the functions do not help, the effect does, which the next trial would find again.
                    None => explained(bench, state, examination, &task, described)?.or(Some(alone)),
                }
            }
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

/// Whether a model with names keeps what all functions together gain: names that each lose little may lose much together.
fn keep_most(without: &Fitted, functions: &Fitted, names: &Fitted) -> bool {
    lost(without, functions, names).is_some_and(|lost| lost.is_no_large_part())
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
    let task = Task { model: &without, base: &base, incumbent: present, before: without.added.len() };
    let Some(described) = functions(bench, &task) else { return Ok(None) };
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
    let Task { incumbent, before, .. } = *task;
    let first = task.model.added.len();
    if !helps(bench, task, &described) {
        let percent = lower_percent(incumbent, &described.1).unwrap_or(f64::NAN);
        info!("additive: the errors on left-out frames fall by {percent:.2} %, not for certain");
        return Ok(None);
    }
    let functions = described.1.clone();
    let mut memory = Memory { hidden: state.memory.hidden.clone(), ..Memory::default() };
    let explained = (first..).zip(&shares).filter(|(_, share)| **share >= LEAST_NAMED);
    // With the number of names when the function was last tried in vain: once another has a name, it may be explained.
    let mut unnamed: Vec<(usize, Option<usize>)> = explained.map(|(place, _)| (place, None)).collect();
    let (mut names, mut refuted) = (0, Vec::new());
    for _ in 0..NAMING_PASSES {
        let mut without_name = Vec::new();
        for (place, tried) in unnamed {
            if tried == Some(names) {
                continue;
            }
            match named(bench, &memory, &described, place)? {
                Naming::Named(named) if keep_most(task.base, &functions, &named.1) => {
                    (described, names) = (*named, names + 1);
                }
                Naming::Missing(effect) => {
                    let name = effect.evidence.name.clone();
                    if let Some(better) = given_missing(bench, state, examination, task, (*effect, &described))? {
                        return Ok(Some(better));
                    }
                    memory.tried.rejected.push(name);
                    without_name.push((place, None));
                }
                Naming::Refuted => refuted.push(place),
                Naming::Named(_) | Naming::Nothing => without_name.push((place, Some(names))),
            }
        }
        unnamed = without_name;
    }
    if !refuted.is_empty() {
        refuted.sort_unstable();
        let model = refuted.into_iter().rev().fold(described.0, |model, place| model.without(place));
        let fitted = bench.fitted(&model.options(bench.declared()))?;
        described = (model, fitted);
        if !helps(bench, task, &described) {
            return Ok(None);
        }
    }
    let (model, fitted) = described;
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

/// Whether the held-out errors fall for certain with the effects that a task has found.
fn helps(bench: &impl Bench, task: &Task<'_>, (model, fitted): &Model) -> bool {
    matches!(fitted.gain_over(task.incumbent, &model.added[task.before..], bench.thresholds()), Gain::Certain(_))
}

/// The model of a task with an effect that was missing, and with the functions that are left given it, explained.
fn given_missing(
    bench: &impl Bench,
    state: &State,
    examination: &Examination,
    task: &Task<'_>,
    (effect, described): (AddedEffect, &Model),
) -> Result<Option<Box<Accepted>>, DiagnoseError> {
    if task.model.added.len() >= task.before + MOST_MISSING {
        return Ok(None);
    }
    let spec = effect.evidence.spec.to_string();
    match fitted_with(bench, task.model, effect) {
        Ok((model, base)) => given(bench, state, examination, &Task { model: &model, base: &base, ..*task }, described),
        Err(error) => {
            info!("additive: given {spec}: {error}");
            Ok(None)
        }
    }
}

/// The model of a task that has an effect more, and with the functions that are left, explained: those that were found without
/// the effect, `described`, may have taken up parts of it. `None` where the held-out errors are not lower.
fn given(
    bench: &impl Bench,
    state: &State,
    examination: &Examination,
    task: &Task<'_>,
    described: &Model,
) -> Result<Option<Box<Accepted>>, DiagnoseError> {
    let nothing = || ((task.model.clone(), task.base.clone()), Vec::new());
    let (with, shares) = functions(bench, task).unwrap_or_else(nothing);
    let percent = lower_percent(&described.1, &with.1);
    info!("additive: given {:?}: {percent:?} %", task.model.specs_from(task.before));
    if percent.is_none_or(|percent| percent <= 0.0) {
        return Ok(None);
    }
    explained(bench, state, examination, task, (with, shares))
}

/// Share of the squared residuals that a function explains, from which on it is explained: names of less would be chance.
const LEAST_NAMED: f64 = 0.02;
/// Passes in which names are looked for.
const NAMING_PASSES: usize = 2;
/// Missing effects given which functions are searched anew.
const MOST_MISSING: usize = 3;

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

    /// The effect does not describe what the function does: the model ends with both.
    #[test]
    fn an_effect_that_says_more_than_all_functions_is_missing_beside_them() {
        let (first, second) = (regressor(1), regressor(2));
        let mut bench = LinearBench::new(&[(FUNCTIONS[0], 0.3, first), ("radial_range", 0.9, second)]);
        bench.functions = vec![FUNCTIONS[0]];
        assert_eq!(names(&together(&bench, &bench.state(&[])).unwrap()), [FUNCTIONS[0]]);
        bench.proposes = Some("radial_range");
        assert_eq!(names(&together(&bench, &bench.state(&[])).unwrap()), ["radial_range", FUNCTIONS[0]]);
    }

    /// It says as much as the function: it is its name.
    #[test]
    fn an_effect_that_says_as_much_takes_the_place_of_its_function() {
        let mut bench = bench([0.6, 0.0]);
        bench.functions = vec![FUNCTIONS[0]];
        bench.proposes = Some("range_offset");
        assert_eq!(names(&together(&bench, &bench.state(&[])).unwrap()), ["range_offset"]);
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
