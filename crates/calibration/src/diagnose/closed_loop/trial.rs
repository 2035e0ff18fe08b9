//! The trial of effects: fits with them, judged by their errors on held-out frames.

use std::collections::BTreeSet;

use tracing::info;

use super::augmented_model::AugmentedModel;
use super::bench::{Bench, Fitted};
use super::proposal::Proposal;
use super::revisit::{Revisited, without_needless};
use super::state::{Accepted, Event, Rejection, State};
use crate::calibrate::CalibrateError;
use crate::diagnose::added_effect::AddedEffect;
use crate::diagnose::examination::Examination;
use crate::diagnose::held_out::Gain;
use crate::diagnose::merit::merit;
use crate::diagnose::possible::Possible;
use crate::diagnose::round::RoundOutcome;

/// The result of a trial.
pub(super) enum Trial {
    /// The errors fall for certain with this model.
    Helps(Box<(AugmentedModel, Fitted)>),
    /// They do not; the first of the effects may be missing, where it is possible.
    DoesNotHelp(Option<Possible>),
    /// The model with the first effect cannot be fitted.
    NotFitted(CalibrateError),
}

/// Tries the effects of a proposal, where they are worth it. Where they help, the model is revisited.
///
/// # Errors
///
/// [`CalibrateError`] where models along the way cannot be fitted again.
pub(super) fn tried(
    bench: &impl Bench,
    state: &State,
    examination: &Examination,
    proposal: Proposal<'_>,
) -> Result<Event, CalibrateError> {
    let State { model, present, memory, .. } = state;
    if let Some(refusal) = proposal.refusal(state, examination, bench.thresholds()) {
        return Ok(Event::Stopped(Some(refusal)));
    }
    let effects = proposal.effects(examination, &present.held_out);
    let names: Vec<String> = effects.iter().map(|effect| effect.evidence.name.clone()).collect();
    let because = match trial(bench, model, present, effects, &memory.tried.together) {
        Trial::Helps(better) => {
            let (better, fitted) = *better;
            let before = model.added.len();
            let effects = better.specs_from(before);
            let Revisited { model, present, removed, .. } =
                without_needless(bench, better, fitted, before, true, examination.tests)?;
            let share = merit(&examination.evidence[proposal.effect]) / examination.cost();
            let largest_share = memory.largest_share.max(share);
            let outcome = Some(RoundOutcome::Added { effects, removed });
            return Ok(Event::Accepted(Box::new(Accepted { model, present, largest_share, outcome })));
        }
        Trial::DoesNotHelp(possible) => Rejection::NoHeldOutGain(possible),
        Trial::NotFitted(error) => Rejection::NotFitted(error.to_string()),
    };
    Ok(Event::Rejected { effects: names, because })
}

/// Tries effects that explain the residuals together, in the given order and only until the held-out errors fall for certain: of
/// two effects that cancel each other in part, one alone does not help. The first effect is possible where they fall with it
/// alone. Sets of effects that are among `tried` did not help before.
pub(super) fn trial(
    bench: &impl Bench,
    model: &AugmentedModel,
    present: &Fitted,
    effects: Vec<AddedEffect>,
    tried: &[BTreeSet<String>],
) -> Trial {
    let before = model.added.len();
    let mut with = model.clone();
    let mut possible = None;
    let mut together = BTreeSet::new();
    for effect in effects {
        together.insert(effect.evidence.name.clone());
        if tried.contains(&together) {
            with.added.push(effect);
            continue;
        }
        let fitted = match fitted_with(bench, &with, effect) {
            Ok((refined, fitted)) => {
                with = refined;
                fitted
            }
            Err(error) if with.added.len() == before => return Trial::NotFitted(error),
            // The first effect can be fitted, but not jointly with this one.
            Err(error) => {
                info!("{error}");
                break;
            }
        };
        match fitted.gain_over(present, &with.added[before..], bench.thresholds()) {
            Gain::Certain(_) => return Trial::Helps(Box::new((without_pixels_of_earlier(with), fitted))),
            Gain::Possible(gain) if with.added.len() == before + 1 => {
                let spec = with.added[before].evidence.spec.clone();
                possible = Some(Possible::new(spec, gain, present.held_out.evaluated.frames.len()));
            }
            Gain::Possible(_) | Gain::None => {}
        }
    }
    Trial::DoesNotHelp(possible)
}

/// The model with an effect more, fitted and refined; the errors of the fit are those after the effect.
pub(super) fn fitted_with(
    bench: &impl Bench,
    model: &AugmentedModel,
    effect: AddedEffect,
) -> Result<(AugmentedModel, Fitted), CalibrateError> {
    let (mut model, fitted) = bench.refined(model.clone().with(effect))?;
    if let Some(last) = model.added.last_mut() {
        last.after = fitted.held_out.clone();
    }
    Ok((model, fitted))
}

/// Models before the last one are no longer compared with others.
fn without_pixels_of_earlier(mut model: AugmentedModel) -> AugmentedModel {
    let last = model.added.len() - 1;
    for earlier in &mut model.added[..last] {
        earlier.after = earlier.after.without_pixels();
    }
    model
}

#[cfg(test)]
mod tests {
    use super::super::linear_bench::{LinearBench, regressor, sum};
    use super::*;

    fn effects(bench: &LinearBench, present: &Fitted, names: &[&str]) -> Vec<AddedEffect> {
        names.iter().map(|name| bench.effect(name, present)).collect()
    }

    /// The trial of effects on the declared model, and the fits that it made.
    fn tried_effects(bench: &LinearBench, names: &[&str], tried: &[BTreeSet<String>]) -> (Trial, Vec<Vec<String>>) {
        let State { model, present, .. } = bench.state(&[]);
        let trial = trial(bench, &model, &present, effects(bench, &present, names), tried);
        (trial, bench.fits.take())
    }

    #[test]
    fn an_effect_that_is_there_helps_and_another_does_not() {
        let bench = LinearBench::new(&[("range_offset", 0.4, regressor(1)), ("radial_range", 0.0, regressor(2))]);
        let (Trial::Helps(with), fits) = tried_effects(&bench, &["range_offset", "radial_range"], &[]) else {
            panic!("the effect is there")
        };
        // The second one is not needed, so no fit with it is made.
        assert_eq!(fits, [["range_offset"]]);
        assert_eq!(with.0.specs_from(0).len(), 1);
        assert_eq!(with.0.added[0].after.errors, with.1.held_out.errors);
        let (trial, fits) = tried_effects(&bench, &["radial_range"], &[]);
        assert!(matches!(trial, Trial::DoesNotHelp(_)));
        assert_eq!(fits, [["radial_range"]]);
    }

    /// y is the small difference of two regressors that are nearly the same.
    #[test]
    fn two_effects_that_cancel_each_other_help_together_only() {
        let (a, difference) = (regressor(1), regressor(2));
        let b = sum(&[(1.0, &a), (0.01, &difference)]);
        let bench = LinearBench::new(&[("range_offset", -50.0, a), ("radial_range", 50.0, b)]);
        let (trial, fits) = tried_effects(&bench, &["range_offset", "radial_range"], &[]);
        assert!(matches!(trial, Trial::Helps(with) if with.0.added.len() == 2));
        assert_eq!(fits.iter().map(Vec::len).collect::<Vec<usize>>(), [1, 2]);
        // A set that was tried in vain is not fitted again.
        let alone = BTreeSet::from(["range_offset".to_owned()]);
        let (trial, fits) = tried_effects(&bench, &["range_offset", "radial_range"], &[alone]);
        assert!(matches!(trial, Trial::Helps(with) if with.0.added.len() == 2));
        assert_eq!(fits, [["range_offset", "radial_range"]]);
    }

    #[test]
    fn effects_that_cannot_be_fitted_are_not_tried_further() {
        let mut bench = LinearBench::new(&[("range_offset", 0.0, regressor(1)), ("radial_range", 0.4, regressor(2))]);
        bench.unfittable = vec!["radial_range"];
        let (trial, _) = tried_effects(&bench, &["radial_range", "range_offset"], &[]);
        assert!(matches!(trial, Trial::NotFitted(_)));
        let (trial, fits) = tried_effects(&bench, &["range_offset", "radial_range"], &[]);
        assert!(matches!(trial, Trial::DoesNotHelp(_)));
        assert_eq!(fits.iter().map(Vec::len).collect::<Vec<usize>>(), [1, 2]);
    }
}
