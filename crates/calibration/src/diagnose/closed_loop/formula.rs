//! Formulas for the structure that the present model leaves, and instead of the effects that were added.

use depthcal_model::{PieceSpec, Placement, Register};
use tracing::info;

use super::augmented_model::AugmentedModel;
use super::bench::{Bench, Fitted};
use super::revisit::{Revisited, without_needless};
use super::state::{Accepted, Event, State};
use super::trial::{Trial, trial};
use crate::calibrate::{CalibrateError, CalibratedCamera};
use crate::diagnose::added_effect::AddedEffect;
use crate::diagnose::discovery::{Chance, Discovery, Refused, Search};
use crate::diagnose::error::DiagnoseError;
use crate::diagnose::evidence::Evidence;
use crate::diagnose::examination::Examination;
use crate::diagnose::held_out::Gain;
use crate::diagnose::left_over::LeftOver;
use crate::diagnose::round::RoundOutcome;
use crate::judge::cross_validation::weighted_gain_percent;

/// Most formulas of a diagnosis.
const MOST_FORMULAS: usize = 2;

/// Whether a formula may be searched: formulas are wanted, there are not too many yet, and a round is left.
pub(super) fn may_be_searched(bench: &impl Bench, state: &State) -> bool {
    bench.options().formulas
        && state.rounds.len() < bench.thresholds().most_rounds
        && state.model.formulas.iter().filter(|formula| !formula.is_smooth_function()).count() < MOST_FORMULAS
}

/// Searches a formula for something that no named effect explains.
///
/// # Errors
///
/// [`CalibrateError`] where models along the way cannot be fitted again.
pub(super) fn formula_for_unexplained(
    bench: &impl Bench,
    state: &State,
    examination: &Examination,
) -> Result<Event, CalibrateError> {
    Ok(match accepted_formula(bench, state, examination, Chance::WithoutBest)? {
        Ok(accepted) => Event::Accepted(Box::new(accepted)),
        // The free function for which it was searched is reported.
        Err(Refused { reason, .. }) => Event::FormulaRefused { reason, together: None },
    })
}

/// Searches a formula where no free function of one covariate shows anything: functions of two covariates together show in none.
///
/// # Errors
///
/// [`CalibrateError`] where models along the way cannot be fitted again.
pub(super) fn formula_for_residuals(
    bench: &impl Bench,
    state: &State,
    examination: &Examination,
) -> Result<Event, CalibrateError> {
    Ok(match accepted_formula(bench, state, examination, Chance::Residuals)? {
        Ok(accepted) => Event::Accepted(Box::new(Accepted { outcome: None, ..accepted })),
        Err(Refused { reason, together }) => {
            Event::FormulaRefused { reason, together: together.as_ref().map(LeftOver::together) }
        }
    })
}

/// The model with a formula for the structure that the present one leaves, without the effects that the formula makes
/// unnecessary: they may have imitated what it describes. Else the reason why there is none.
fn accepted_formula(
    bench: &impl Bench,
    state: &State,
    examination: &Examination,
    chance: Chance<'_>,
) -> Result<Result<Accepted, Refused>, CalibrateError> {
    let State { model, present, memory, .. } = state;
    bench.report("searching a formula", &model.options(bench.declared()));
    let discovery = match bench.discover(&present.fit, chance, examination, &model.names(&present.fit)) {
        Search::Found(discovery) => discovery,
        Search::Nothing(refused) => {
            info!("no formula: {}", refused.reason);
            return Ok(Err(refused));
        }
    };
    let (spec, text) = (discovery.effect.spec(), discovery.effect.text());
    let Some((model, fitted)) = with_formula(bench, model, present, *discovery) else {
        let reason = format!("{text} does not lower the error on left-out frames for certain");
        return Ok(Err(Refused { reason, together: None }));
    };
    let largest_share = memory.largest_share.max(model.share_of_last(examination.cost()));
    let Revisited { model, present, removed, .. } = without_needless(bench, model, fitted, 0, true, examination.tests)?;
    let outcome = Some(RoundOutcome::Added { effects: vec![spec], removed });
    Ok(Ok(Accepted { model, present, largest_share, outcome }))
}

/// The model with a formula, where the held-out errors fall for certain with it and no frames refute it.
pub(super) fn with_formula(
    bench: &impl Bench,
    model: &AugmentedModel,
    present: &Fitted,
    discovery: Discovery,
) -> Option<(AugmentedModel, Fitted)> {
    if discovery.is_refuted() {
        info!("a formula is refuted by frames that the search has not seen: {}", discovery.effect.text());
        return None;
    }
    let (spec, p_value) = (discovery.effect.spec(), discovery.p_value);
    let placements = discovery.places_not_told_apart.iter();
    let placements = placements.map(|place| Placement { of: place.of, on: Some(place.on) }).collect();
    let mut model = model.clone();
    model.formulas.push(discovery);
    let register = model.register(bench.declared());
    let evidence = Evidence { p_value, ..evidence_of(bench, &present.fit, &register, spec)? };
    let effect = AddedEffect {
        placements_not_told_apart: placements,
        ..AddedEffect::alone(evidence, p_value, present.held_out.clone())
    };
    match trial(bench, &model, present, vec![effect], &[]) {
        Trial::Helps(accepted) => Some(*accepted),
        Trial::DoesNotHelp(_) => None,
        Trial::NotFitted(error) => {
            info!("a formula cannot be fitted: {error}");
            None
        }
    }
}

/// The evidence for an effect or a formula, which a register knows, in what a fit leaves; `None` where the problem cannot be
/// evaluated.
pub(super) fn evidence_of(
    bench: &impl Bench,
    fit: &CalibratedCamera,
    register: &Register,
    spec: PieceSpec,
) -> Option<Evidence> {
    let test = bench.test(fit, register, &spec)?;
    Some(Evidence {
        name: spec.name.clone(),
        value: None,
        reduced: None,
        along: None,
        p_value: test.score.p_value,
        score: test.score,
        gains: test.gains,
        expected_size_mm: f64::NAN,
        minimal_detectable_mm: f64::NAN,
        block: register.make(&spec, None).ok()?,
        index: 0,
        spec,
    })
}

/// Compares a formula with all added effects, once: effects of the catalogue can imitate an error that the catalogue lacks.
/// `None` where formulas are not wanted, nothing was added, or the comparison has been made.
///
/// # Errors
///
/// [`DiagnoseError`] where the declared model cannot be examined.
pub(super) fn formula_instead(bench: &impl Bench, state: &State) -> Result<Option<Event>, DiagnoseError> {
    if !bench.options().formulas || state.model.added.is_empty() || state.memory.compared_with_formula {
        return Ok(None);
    }
    let State { first, present, .. } = state;
    bench.report("searching a formula instead", bench.declared());
    // With the noise that the effects leave: under the declared model what it lacks counts as noise, most where noise is least.
    let fit = &CalibratedCamera { noise: present.fit.noise, ..first.fit.clone() };
    let examination = bench.examine(fit)?;
    let chance = Chance::Complete(&present.fit);
    let instead = match bench.discover(fit, chance, &examination, &AugmentedModel::default().names(fit)) {
        Search::Found(discovery) => with_formula_instead(bench, state, *discovery),
        Search::Nothing(refused) => {
            info!("no formula instead: {}", refused.reason);
            None
        }
    };
    let accepted = instead.map(|(model, present)| {
        let largest_share = model.share_of_last(first.fit.cost);
        Box::new(Accepted { model, present, largest_share, outcome: None })
    });
    Ok(Some(Event::FormulaCompared(accepted)))
}

/// The model with a formula in the place of all added effects: where the held-out errors with it alone are lower for certain and
/// the effects lack a part that matters, and where it says the same with less, one formula of no more parameters for several
/// effects without which the errors are not lower for certain. A formula that is a special case of an effect always predicts a
/// little better, because it has fewer parameters: that refutes no name.
fn with_formula_instead(bench: &impl Bench, state: &State, discovery: Discovery) -> Option<(AugmentedModel, Fitted)> {
    let State { model, present, first, .. } = state;
    let before = &model.added;
    let without = AugmentedModel::default();
    let (mut with, fitted) = with_formula(bench, &without, first, discovery)?;
    let thresholds = bench.thresholds();
    let parameters = |effects: &[AddedEffect]| effects.iter().map(|e| e.evidence.block.theta.len()).sum::<usize>();
    let gained = |fitted: &Fitted| {
        let [without, with] = [first, fitted].map(|f| &f.held_out.evaluated);
        weighted_gain_percent(without, with, &present.fit.noise.depth).map_or(0.0, |gain| gain.value)
    };
    let (of_effects, of_formula) = (gained(present), gained(&fitted));
    let is_better = matches!(fitted.gain_over(present, &with.added, thresholds), Gain::Certain(_))
        && of_effects < thresholds.least_explained_of_own * of_formula;
    info!("errors fall by {of_effects:.2} % with the effects, by {of_formula:.2} % with a formula instead");
    let says_it_with_less = before.len() > with.added.len()
        && parameters(before) >= parameters(&with.added)
        && !matches!(present.gain_over(&fitted, before, thresholds), Gain::Certain(_));
    if !(is_better || says_it_with_less) {
        return None;
    }
    if let Some(formula) = with.formulas.last_mut() {
        formula.replaced = before.iter().map(|effect| effect.evidence.spec.clone()).collect();
    }
    Some((with, fitted))
}

#[cfg(test)]
mod tests {
    use super::super::linear_bench::{FORMULA, LinearBench, regressor, sum};
    use super::*;
    use crate::diagnose::linear_examination::{Planted, examined};
    use crate::diagnose::merit::merit;

    /// A problem with a formula of a size, an effect that resembles the formula, and one that is the same.
    fn bench(size: f64) -> LinearBench {
        let (formula, other) = (regressor(1), regressor(2));
        let resembling = sum(&[(0.8, &formula), (0.6, &other)]);
        let effects = [
            ("incidence_bias", 0.0, formula.clone()),
            (FORMULA, size, formula),
            ("range_offset", 0.0, resembling),
            ("radial_range", 0.5, regressor(3)),
        ];
        let mut bench = LinearBench::new(&effects);
        bench.finds_formula = true;
        bench
    }

    fn names(model: &AugmentedModel) -> Vec<&str> {
        model.added.iter().map(|effect| effect.evidence.name.as_str()).collect()
    }

    #[test]
    fn a_formula_that_helps_replaces_the_effects_that_imitated_it() {
        let bench = bench(0.5);
        let state = bench.state(&["range_offset", "radial_range"]);
        let examination = examined(Planted::default(), 1);
        let event = formula_for_unexplained(&bench, &state, &examination).unwrap();
        let Event::Accepted(accepted) = event else { panic!("the formula is there") };
        assert_eq!(names(&accepted.model), ["radial_range", FORMULA]);
        assert_eq!(accepted.model.formulas.len(), 1);
        let Some(RoundOutcome::Added { effects, removed }) = accepted.outcome else { panic!("no outcome") };
        assert_eq!((effects[0].name.as_str(), removed[0].name.as_str()), (FORMULA, "range_offset"));
        assert_eq!(accepted.largest_share, merit(&accepted.model.added[1].evidence) / examination.cost());
        // An effect before it was larger.
        let mut state = state;
        state.memory.largest_share = 0.5;
        let event = formula_for_unexplained(&bench, &state, &examination).unwrap();
        assert!(matches!(event, Event::Accepted(accepted) if accepted.largest_share == 0.5));
    }

    #[test]
    fn a_formula_that_does_not_help_is_refused() {
        let bench = bench(0.0);
        let state = bench.state(&["radial_range"]);
        let examination = examined(Planted::default(), 1);
        for event in [
            formula_for_unexplained(&bench, &state, &examination).unwrap(),
            formula_for_residuals(&bench, &state, &examination).unwrap(),
        ] {
            let Event::FormulaRefused { reason, together: None } = event else { panic!("the formula is not there") };
            assert!(reason.contains("does not lower the error"), "{reason}");
        }
        assert_eq!((names(&state.model), state.model.formulas.len()), (vec!["radial_range"], 0));
    }

    #[test]
    fn a_formula_takes_the_place_of_effects_that_imitate_it_once() {
        let bench = bench(0.5);
        let mut state = bench.state(&["range_offset"]);
        let Some(Event::FormulaCompared(Some(accepted))) = formula_instead(&bench, &state).unwrap() else {
            panic!("the formula explains more")
        };
        assert_eq!(names(&accepted.model), [FORMULA]);
        assert_eq!(accepted.model.formulas[0].replaced[0].name, "range_offset");
        state.apply(Event::FormulaCompared(Some(accepted)));
        assert!(formula_instead(&bench, &state).unwrap().is_none());
        // Effects that explain as much with as little keep their names.
        let state = bench.state(&["incidence_bias"]);
        assert!(matches!(formula_instead(&bench, &state).unwrap(), Some(Event::FormulaCompared(None))));
        assert!(formula_instead(&bench, &bench.state(&[])).unwrap().is_none());
    }

    #[test]
    fn formulas_are_searched_where_they_are_wanted() {
        let mut bench = bench(0.5);
        let mut state = bench.state(&["range_offset"]);
        assert!(may_be_searched(&bench, &state));
        let Some(event) = formula_instead(&bench, &state).unwrap() else { panic!("formulas are wanted") };
        state.apply(event);
        assert!(may_be_searched(&bench, &state), "one formula of two");
        bench.options.formulas = false;
        assert!(!may_be_searched(&bench, &state));
        assert!(formula_instead(&bench, &bench.state(&["range_offset"])).unwrap().is_none());
    }
}
