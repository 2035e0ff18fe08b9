//! Earlier decisions looked at again under another model:
//!
//! | decision | when | step |
//! |---|---|---|
//! | effects in the model | effects or a formula were added | [`without_needless`] |
//! | effects of the lens in the model | something is unexplained | [`without_hidden_lens_effects`] |
//! | frames that are fitted | effects were added | [`other_frames_excluded`] |
//! | frames that are excluded | no round is left | [`frames_readmitted`] |
//! | effects of the last model | no round is left | [`without_uncertain`](super::last_model::without_uncertain) |

use depthcal_model::PieceSpec;
use depthcal_model::hook::HookKind;
use depthcal_solver::score::ScoreError;
use depthcal_statistics::mean_to_standard_error;
use nalgebra::{DMatrix, DVector};
use tracing::info;

use super::augmented_model::AugmentedModel;
use super::bench::{Bench, Fitted};
use super::fitter::Fitter;
use super::frames::{readmitted, without_outlying};
use super::state::{Event, FramesChanged, State, TakenOut};
use crate::calibrate::{CalibrateError, CalibratedCamera};
use crate::diagnose::added_effect::AddedEffect;
use crate::diagnose::error::DiagnoseError;
use crate::diagnose::held_out::{Gain, HeldOut};
use crate::diagnose::lens_in_image::shows_in_images;
use crate::diagnose::merit::significant;
use crate::diagnose::thresholds::Thresholds;

/// Half the Wald statistic of an effect that is kept without a fit, over what an effect must explain to be plainly needed: the
/// statistic takes residuals of a frame for independent, and is quadratic.
const WALD_FACTOR: f64 = 5.0;

/// A model without the effects that later ones have made unnecessary.
pub(super) struct Revisited {
    pub model: AugmentedModel,
    pub present: Fitted,
    /// The removed effects.
    pub removed: Vec<PieceSpec>,
    /// The number of effects that remain of those before the ones that were added together.
    pub earlier: usize,
}

/// Removes effects that later ones have made unnecessary: an effect that resembles two others is found before them. Of those that
/// were added together, from number `together` on, each has to gain for certain given the others: one that is certain must not
/// carry another that is not. But of several that are certain together one stays. The last effect stays where its trial has just
/// been made (`is_last_tried`).
///
/// # Errors
///
/// [`CalibrateError`] where models along the way cannot be fitted again.
pub(super) fn without_needless(
    bench: &impl Bench,
    model: AugmentedModel,
    present: Fitted,
    together: usize,
    is_last_tried: bool,
    tests: usize,
) -> Result<Revisited, CalibrateError> {
    let mut revisited = Revisited { model, present, removed: Vec::new(), earlier: together };
    let (mut i, mut first_changed) = (0, usize::MAX);
    let mut removal = Removal::from(&revisited.present);
    let protected = usize::from(is_last_tried);
    while i + protected < revisited.model.added.len() {
        let (effect, is_new) = (&revisited.model.added[i], i >= revisited.earlier);
        if !is_new && is_plain_by_wald(&revisited.present.fit, effect, bench.thresholds()) {
            i += 1;
            continue;
        }
        let spec = effect.evidence.spec.clone();
        let rest_of_model = revisited.model.without(i);
        match fitted_if_needless(bench, &rest_of_model, effect, &revisited.present, is_new, tests) {
            Ok(Some(without)) if is_new && !removal.adds(effect, &without, bench.thresholds()) => i += 1,
            Ok(Some(without)) => {
                revisited.earlier -= usize::from(!is_new);
                first_changed = first_changed.min(i);
                (revisited.model, revisited.present) = (rest_of_model, without);
                revisited.removed.push(spec);
            }
            Ok(None) => i += 1,
            Err(error) => {
                info!("without {spec}: {error}");
                i += 1;
            }
        }
    }
    // Of effects that were not tried one after the other, no errors along the way are known.
    let first = if is_last_tried { first_changed } else { first_changed.min(revisited.earlier) };
    revisited.model = with_errors_along(bench, revisited.model, first, &revisited.present.held_out)?;
    Ok(revisited)
}

/// Effects that are removed from a model one by one. Those that are certain together are not all removed: each of them may gain
/// little given the others.
struct Removal {
    whole: Fitted,
    removed: Vec<AddedEffect>,
}

impl Removal {
    fn from(whole: &Fitted) -> Self {
        Self { whole: whole.clone(), removed: Vec::new() }
    }

    /// Adds an effect, unless it is certain together with those that are removed already; `without` is the model without all.
    fn adds(&mut self, effect: &AddedEffect, without: &Fitted, thresholds: &Thresholds) -> bool {
        self.removed.push(effect.clone());
        let several = self.removed.len() > 1;
        if several && matches!(self.whole.gain_over(without, &self.removed, thresholds), Gain::Certain(_)) {
            info!("{} stays: it is certain together with what was removed before", effect.evidence.spec);
            self.removed.pop();
            return false;
        }
        true
    }
}

/// Whether the parameters of an effect alone say that it is plainly needed: half their Wald statistic, which predicts what the
/// cost would rise by without it, is [`WALD_FACTOR`] times what is asked of a plain effect. Then no fit without it is made.
pub(super) fn is_plain_by_wald(fit: &CalibratedCamera, effect: &AddedEffect, thresholds: &Thresholds) -> bool {
    let wald = || {
        let covariance = fit.covariance.as_ref()?;
        let (block, range) = fit.camera.blocks_with_ranges().find(|(b, _)| b.name() == effect.evidence.name)?;
        let free: Vec<usize> = (0..block.theta.len()).filter(|i| block.free[*i]).collect();
        let nominals = block.parameters();
        let change = DVector::from_iterator(free.len(), free.iter().map(|i| block.theta[*i] - nominals[*i].nominal));
        let of_effect =
            DMatrix::from_fn(free.len(), free.len(), |i, j| covariance[(range.start + free[i], range.start + free[j])]);
        Some(change.dot(&of_effect.cholesky()?.solve(&change)))
    };
    wald().is_some_and(|wald: f64| 0.5 * wald > WALD_FACTOR * thresholds.plain_share * fit.cost)
}

/// The fit of `model`, which lacks an effect, where the effect is not needed: it is insignificant given the others, or the model
/// `with` it is no better on held-out frames, for certain where the effect is new.
fn fitted_if_needless(
    bench: &impl Bench,
    model: &AugmentedModel,
    effect: &AddedEffect,
    with: &Fitted,
    is_new: bool,
    tests: usize,
) -> Result<Option<Fitted>, CalibrateError> {
    let (declared, thresholds) = (bench.declared(), bench.thresholds());
    let options = model.options(declared);
    let fit = bench.fit(&options)?;
    let test = bench.test(&fit, &options.register, &effect.evidence.spec);
    let counts = test.as_ref().is_none_or(|t| significant(t.score.p_value, tests, &t.gains, thresholds));
    let is_plain = test.as_ref().is_some_and(|t| {
        t.gains.iter().sum::<f64>() > thresholds.plain_share * t.cost
            && mean_to_standard_error(&t.gains) > thresholds.plain_t
    });
    if counts && is_plain && !is_new {
        return Ok(None);
    }
    let without = Fitted { held_out: bench.held_out(&fit, &options)?, fit };
    let is_needed = match with.gain_over(&without, std::slice::from_ref(effect), thresholds) {
        Gain::Certain(_) => counts,
        Gain::Possible(_) => counts && !is_new,
        Gain::None => false,
    };
    Ok((!is_needed).then_some(without))
}

/// The model with the held-out errors of the models along the way computed anew, from the effect at `first` on; those of the last
/// model are `present`.
pub(super) fn with_errors_along(
    bench: &impl Bench,
    mut model: AugmentedModel,
    first: usize,
    present: &HeldOut,
) -> Result<AugmentedModel, CalibrateError> {
    for i in first..model.added.len() {
        let is_last = i + 1 == model.added.len();
        model.added[i].after = if is_last {
            present.clone()
        } else {
            bench.fitted(&model.first(i + 1).options(bench.declared()))?.held_out.without_pixels()
        };
    }
    Ok(model)
}

/// Removes the effects of the lens that were added and that images alone do not show, each given the others. `None` where there
/// are none.
///
/// # Errors
///
/// [`DiagnoseError`] where the model without them cannot be fitted or examined.
pub(super) fn without_hidden_lens_effects(bench: &impl Bench, state: &State) -> Result<Option<Event>, DiagnoseError> {
    let hidden = hidden_lens_effects(bench, &state.model, &state.present.fit)?;
    if hidden.is_empty() {
        return Ok(None);
    }
    Ok(Some(Event::TakenOut(Box::new(taken_out(bench, state.model.clone(), hidden)?))))
}

fn hidden_lens_effects(
    bench: &impl Bench,
    model: &AugmentedModel,
    fit: &CalibratedCamera,
) -> Result<Vec<PieceSpec>, ScoreError> {
    let mut hidden = Vec::new();
    let of_lens = model.added.iter().map(|added| &added.evidence).filter(|e| e.block.hook() == HookKind::Lens);
    for effect in of_lens {
        let camera = fit.camera.filtered(|block| block.name() != effect.name);
        let without = CalibratedCamera { camera, ..fit.clone() };
        if !shows_in_images(&without, &bench.declared().register, effect, &[], bench.thresholds())? {
            hidden.push(effect.spec.clone());
        }
    }
    Ok(hidden)
}

/// The model without some effects, fitted.
fn taken_out(
    bench: &impl Bench,
    mut model: AugmentedModel,
    effects: Vec<PieceSpec>,
) -> Result<TakenOut, CalibrateError> {
    model.added.retain(|added| !effects.contains(&added.evidence.spec));
    let present = bench.fitted(&model.options(bench.declared()))?;
    let model = with_errors_along(bench, model, 0, &present.held_out)?;
    Ok(TakenOut { model, present, effects })
}

/// Excludes frames that stand out under the present model. `None` where there are none.
///
/// # Errors
///
/// [`CalibrateError`] where the models cannot be fitted without them.
pub(super) fn other_frames_excluded(fitter: &Fitter<'_>, state: &State) -> Result<Option<Event>, CalibrateError> {
    let (model, round) = (&state.model, state.rounds.len());
    let Some((frames, fit)) = without_outlying(fitter, round, model, (&state.frames, &state.present.fit), 0.0)? else {
        return Ok(None);
    };
    let bench = fitter.on(&frames.used, round);
    // Errors before and after have to be about the same frames.
    let first = bench.fitted(bench.declared())?;
    let present = Fitted { held_out: bench.held_out(&fit, &model.options(bench.declared()))?, fit };
    let model = with_errors_along(&bench, model.clone(), 0, &present.held_out)?;
    Ok(Some(Event::FramesChanged(Box::new(FramesChanged { frames, model, present, first }))))
}

/// Readmits excluded frames that the present model explains. `None` where nothing was added, or where it explains none.
///
/// # Errors
///
/// [`CalibrateError`] where the models cannot be fitted to these frames too.
pub(super) fn frames_readmitted(fitter: &Fitter<'_>, state: &State) -> Result<Option<Event>, CalibrateError> {
    let model = &state.model;
    if model.added.is_empty() {
        return Ok(None);
    }
    let Some(frames) = readmitted(fitter, model, &state.frames)? else { return Ok(None) };
    let bench = fitter.on(&frames.used, state.rounds.len());
    let present = bench.fitted(&model.options(bench.declared()))?;
    let first = bench.fitted(bench.declared())?;
    let model = with_errors_along(&bench, model.clone(), 0, &present.held_out)?;
    Ok(Some(Event::FramesChanged(Box::new(FramesChanged { frames, model, present, first }))))
}

#[cfg(test)]
mod tests {
    use depthcal_simulate::{CameraTruth, Effect, Kind, PointOptions, Simulation};

    use super::super::linear_bench::{LinearBench, regressor, sum};
    use super::super::trial::fitted_with;
    use super::*;
    use crate::diagnose::examination::examine;
    use crate::diagnose::options::CameraDiagnoseOptions;
    use crate::diagnose::step::steps;
    use crate::simulated;

    fn names(specs: &[PieceSpec]) -> Vec<&str> {
        specs.iter().map(|spec| spec.name.as_str()).collect()
    }

    /// An effect that resembles the sum of two others; the others are there.
    fn of_a_sum() -> LinearBench {
        let (b, c, other) = (regressor(1), regressor(2), regressor(3));
        let resembling = sum(&[(0.7, &b), (0.7, &c), (0.2, &other)]);
        LinearBench::new(&[("range_offset", 0.0, resembling), ("radial_range", 0.5, b), ("incidence_bias", 0.5, c)])
    }

    #[test]
    fn an_effect_that_later_ones_make_needless_is_removed() {
        let bench = of_a_sum();
        let State { model, present, .. } = bench.state(&["range_offset", "radial_range", "incidence_bias"]);
        let together = model.added.len();
        let Revisited { model, present, removed, .. } =
            without_needless(&bench, model, present, together, true, 20).unwrap();
        assert_eq!(names(&removed), ["range_offset"]);
        assert_eq!(names(&model.specs_from(0)), ["radial_range", "incidence_bias"]);
        // Without the removed one, and the models along the way; the others are plainly needed by their parameters alone.
        assert_eq!(bench.fits.take(), [vec!["radial_range", "incidence_bias"], vec!["radial_range"]]);
        assert_eq!(model.added[1].after.errors, present.held_out.errors);
    }

    #[test]
    fn the_effects_of_one_trial_have_to_gain_each_by_itself() {
        let bench = LinearBench::new(&[("range_offset", 0.0, regressor(1)), ("radial_range", 0.5, regressor(2))]);
        let State { model, present, .. } = bench.state(&["range_offset", "radial_range"]);
        let revisited = without_needless(&bench, model, present, 0, true, 20).unwrap();
        assert_eq!(names(&revisited.removed), ["range_offset"]);
        let bench = LinearBench::new(&[("range_offset", 0.5, regressor(1)), ("radial_range", 0.5, regressor(2))]);
        let State { model, present, .. } = bench.state(&["range_offset", "radial_range"]);
        let revisited = without_needless(&bench, model, present, 0, true, 20).unwrap();
        assert!(revisited.removed.is_empty());
        // Of new effects a fit without is made, however plain they are.
        assert_eq!(bench.fits.take(), [["radial_range"]]);
    }

    /// Four effects, of which each may be too small to be certain given the others.
    #[test]
    fn effects_that_are_certain_together_are_not_all_removed() {
        let effects = ["range_offset", "radial_range", "incidence_bias", "quadratic_depth"];
        let mut losses = 0;
        for (size, seed) in
            [0.1, 0.12, 0.14, 0.16].into_iter().flat_map(|size| [1, 11, 21, 31].map(|seed| (size, seed)))
        {
            let planted: Vec<_> =
                effects.iter().zip(seed..).map(|(name, seed)| (*name, size, regressor(seed))).collect();
            let bench = LinearBench::new(&planted);
            let state = bench.state(&effects);
            let (model, whole) = (state.model.clone(), state.present.clone());
            let is_lost = |model: &AugmentedModel, present: &Fitted| {
                let is_removed =
                    |effect: &&AddedEffect| model.added.iter().all(|e| e.evidence.name != effect.evidence.name);
                let removed: Vec<_> = state.model.added.iter().filter(is_removed).cloned().collect();
                removed.len() > 1 && matches!(whole.gain_over(present, &removed, bench.thresholds()), Gain::Certain(_))
            };
            let revisited = without_needless(&bench, model, whole.clone(), 0, false, 20).unwrap();
            losses += usize::from(is_lost(&revisited.model, &revisited.present));
        }
        assert_eq!(losses, 0);
    }

    #[test]
    fn an_effect_without_which_nothing_can_be_fitted_stays() {
        let mut bench = of_a_sum();
        let State { model, present, .. } = bench.state(&["range_offset", "radial_range", "incidence_bias"]);
        bench.unfittable = vec!["radial_range"];
        let revisited = without_needless(&bench, model, present, 3, true, 20).unwrap();
        assert!(revisited.removed.is_empty());
        assert_eq!(revisited.model.added.len(), 3);
    }

    #[test]
    fn errors_along_the_way_are_those_without_the_effects_that_are_taken_out() {
        let bench = of_a_sum();
        let State { model, .. } = bench.state(&["radial_range", "range_offset", "incidence_bias"]);
        let taken_out = taken_out(&bench, model, vec![PieceSpec::new("range_offset")]).unwrap();
        let expected = bench.state(&["radial_range", "incidence_bias"]);
        let errors = |model: &AugmentedModel| model.added.iter().map(|e| e.after.errors).collect::<Vec<_>>();
        assert_eq!(errors(&taken_out.model), errors(&expected.model));
        assert_eq!(names(&taken_out.effects), ["range_offset"]);
    }

    #[test]
    fn needless_effects_of_a_simulated_camera_are_removed() {
        let effect = Effect::new("cyclic_depth", 4.0).unwrap();
        let simulation = Simulation::new(CameraTruth::published(1).unwrap(), Kind::General(1), &[effect], 5);
        let capture = simulated::capture(&simulation.observe_points(&PointOptions::default()).unwrap());
        let options = CameraDiagnoseOptions::default();
        let fitter = Fitter::new(capture.clone(), None, &options);
        let bench = fitter.on(&capture, 0);
        let first = bench.fitted(bench.declared()).unwrap();
        let examination = examine(&first.fit, &options.calibrate.register, &options.thresholds).unwrap();
        let (mut model, mut present) = (AugmentedModel::default(), first.clone());
        for name in ["incidence_bias", "cyclic_depth", "radial_range"] {
            let evidence = examination.effects().find(|e| e.name == name).unwrap().clone();
            let effect = AddedEffect::alone(evidence, 0.0, first.held_out.clone());
            (model, present) = fitted_with(&bench, &model, effect).unwrap();
        }
        // The last effect stays: the loop tests it when it is added.
        let together = model.added.len();
        let revisited = without_needless(&bench, model, present, together, true, examination.tests).unwrap();
        assert_eq!(names(&revisited.removed), ["incidence_bias"]);
        assert_eq!(names(&revisited.model.specs_from(0)), ["cyclic_depth", "radial_range"]);
        // Every step begins with the errors with which the one before ended.
        let Revisited { model, present, .. } = revisited;
        let steps = steps(&model.added, &first.held_out, &present.fit).unwrap();
        assert_eq!(steps[0].before, first.held_out.errors);
        assert_eq!(steps[1].before, steps[0].after);
        assert_eq!(steps[1].after, present.held_out.errors);
        assert!(steps[0].after.depth_rms_mm < steps[0].before.depth_rms_mm);
    }
}
