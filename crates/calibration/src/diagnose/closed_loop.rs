//! The loop: rounds of examination, decision and fit.

use std::collections::BTreeSet;

use depthcal_io::Verdict;
use depthcal_model::PieceSpec;
use tracing::info;

use super::augmented_model::{AddedEffect, Addition, AugmentedModel, Fitted};
use super::bad_frames::without_duplicates;
use super::decision::{Decision, decide};
use super::diagnosis::Diagnosis;
use super::discovery::{self, Chance, Discovery, Refused, Search, components};
use super::error::DiagnoseError;
use super::evidence::Evidence;
use super::examination::{Examination, examine};
use super::experiment_design::{distinguishing_frames, frames_against_rivals, missing_covariates};
use super::frame_planes::{frame_planes, share_with_own_plane};
use super::free_functions::Along;
use super::free_map::FREE_MAP;
use super::held_out::HeldOut;
use super::left_over::LeftOver;
use super::lens_in_image::shows_in_images;
use super::merit::merit;
use super::options::DiagnoseOptions;
use super::own_function::share_of_own_function;
use super::possible::Possible;
use super::pure_error::pure_error;
use super::round::{Refutation, Refuted, Round, RoundOutcome};
use super::step::steps;
use super::stepwise_selection::score_given;
use super::thresholds::Thresholds;
use crate::calibrate::{CalibrateOptions, Calibrated, implausible_scale, with_frame_scatter};
use crate::observe::Capture;

/// Rounds in which the smoothness of the free map is chosen.
const FREE_MAP_ROUNDS: usize = 4;

/// Diagnoses a capture: which effects does the declared model lack? Errors are those on `verify` where it is given, else on
/// frames that cross-validation holds out.
///
/// # Errors
///
/// [`DiagnoseError`] where there is no depth, or where a model cannot be fitted or examined.
pub fn diagnose(
    capture: &Capture,
    verify: Option<&Capture>,
    options: &DiagnoseOptions,
) -> Result<Diagnosis, DiagnoseError> {
    if !capture.has_depth() {
        return Err(DiagnoseError::NoDepth { dataset: capture.name.clone() });
    }
    // With more rounds the smoothness of the free map and the noise may settle where the map is flat and all that it should describe
    // counts as noise.
    let calibrate = CalibrateOptions {
        frame_planes: false,
        smoothness_rounds: FREE_MAP_ROUNDS,
        samples_for_search: true,
        ..options.calibrate.for_board(&capture.target)
    };
    let options = &DiagnoseOptions { calibrate, ..options.clone() };
    let (register, thresholds) = (&options.calibrate.register, &options.thresholds);
    let (capture, mut bad_frames) = without_duplicates(capture, thresholds);
    let whole = capture.clone();
    let mut model = AugmentedModel::new(capture, verify, options);
    let mut fit = model.fit_declared(&mut bad_frames)?;
    model.exclude_bad_frames(&mut fit, &mut bad_frames, thresholds.gross_plane_mm)?;
    model.explain_exclusions(&whole, &fit, &mut bad_frames);
    let declarations = implausible_scale(&fit.capture, thresholds.plausible_scale_deviation).into_iter().collect();
    let mut first = Fitted { held_out: model.held_out(&fit, model.declared())?, fit };
    let mut present = first.clone();
    let mut rounds: Vec<Round> = Vec::new();
    // Largest merit of an added effect as a share of the cost.
    let mut largest_share = 0.0_f64;
    let mut left_over: Vec<LeftOver> = Vec::new();
    let mut possible: Vec<Possible> = Vec::new();
    // Effects that did not reduce the held-out errors of the present model.
    let mut rejected: Vec<String> = Vec::new();
    // Lens effects that images do not show: they are not added again.
    let mut hidden: Vec<String> = Vec::new();
    // Those that were tried together.
    let mut tried: Vec<BTreeSet<String>> = Vec::new();
    // Why no formula was found for what is left.
    let mut formula_refused: Option<String> = None;
    // Where nothing was added the fit is the same, and so is what it leaves.
    let mut unchanged: Option<Examination> = None;
    let examination = loop {
        let examination = loop {
            model.round += 1;
            let examination = match unchanged.take() {
                Some(examination) => examination,
                None => {
                    model.report("examining what is left", &model.present());
                    examine(&present.fit, register, thresholds)?
                }
            };
            let least_share = thresholds.least_relative_gain * largest_share;
            let (decision, refuted) =
                decide_without_refuted(&present.fit, &examination, least_share, [&rejected, &hidden], options)?;
            rounds.push(Round::new(&examination, decision.clone(), refuted));
            match &decision {
                Decision::Nothing => break examination,
                Decision::Unexplained { free, explained, .. } => {
                    let found = &examination.evidence[*free];
                    let share_of_cost = merit(found) / examination.cost();
                    let least_share = thresholds.least_unexplained_share;
                    if merit(found) < least_share * examination.cost() {
                        conclude(&mut rounds, RoundOutcome::Negligible { share_of_cost, least_share });
                        break examination;
                    }
                    let effects = match rounds.len() < thresholds.most_rounds {
                        true => model.remove_hidden_lens_effects(&mut present)?,
                        false => Vec::new(),
                    };
                    if !effects.is_empty() {
                        hidden.extend(effects.iter().map(|spec| spec.name.clone()));
                        conclude(&mut rounds, RoundOutcome::TakenOut { effects });
                        continue;
                    }
                    if let Some(fitted) = formula_instead(&mut model, &first, &present, thresholds)? {
                        largest_share = share_of_last(&model, first.fit.cost);
                        present = fitted;
                        rejected.clear();
                        tried.clear();
                        continue;
                    }
                    if options.formulas && rounds.len() < thresholds.most_rounds && model.formulas.len() < MOST_FORMULAS
                    {
                        model.report("searching a formula", &model.present());
                        match find_formula(&mut model, &examination, &present, Chance::WithoutBest, thresholds)? {
                            Ok((spec, fitted)) => {
                                largest_share = largest_share.max(share_of_last(&model, examination.cost()));
                                present = fitted;
                                rejected.clear();
                                tried.clear();
                                // Effects that were added before may have imitated what the formula describes.
                                let removed = model.remove_unnecessary(&mut present, 0, examination.tests)?;
                                conclude(&mut rounds, RoundOutcome::Added { effects: vec![spec], removed });
                                continue;
                            }
                            Err(refused) => formula_refused = Some(refused.reason),
                        }
                    }
                    left_over.extend(LeftOver::free_function(found, *explained));
                    if found.along.is_some_and(Along::is_of_the_pixel) {
                        let tested = examination.free_functions().count() as f64;
                        model.add_free_map(found, &mut present, (found.p_value * tested).min(1.0));
                    }
                    let map = model.added.last().filter(|added| added.evidence.name == FREE_MAP);
                    let outcome = map.map_or(RoundOutcome::Reported, |m| RoundOutcome::FreeMapAdded {
                        map: m.evidence.spec.clone(),
                    });
                    conclude(&mut rounds, outcome);
                    break examination;
                }
                Decision::Add { effect, jointly_with, indistinguishable, .. } => {
                    let found = &examination.evidence[*effect];
                    if rounds.len() >= thresholds.most_rounds {
                        let outcome = RoundOutcome::RoundLimit { rounds: rounds.len() };
                        conclude(&mut rounds, outcome);
                        break examination;
                    }
                    if rejected.len() >= thresholds.most_rejected {
                        conclude(&mut rounds, RoundOutcome::RejectionLimit { rejected: rejected.len() });
                        break examination;
                    }
                    let members = std::iter::once(effect).chain(jointly_with);
                    let gain: f64 = members.map(|i| examination.evidence[*i].gain()).sum();
                    let (share_of_cost, least_share) =
                        (gain / examination.cost(), least_share_worth_a_trial(thresholds));
                    if share_of_cost < least_share {
                        conclude(&mut rounds, RoundOutcome::Negligible { share_of_cost, least_share });
                        break examination;
                    }
                    let before = model.added.len();
                    let effects =
                        effects_to_add(&examination, *effect, jointly_with, indistinguishable, &present.held_out);
                    let names: Vec<String> = effects.iter().map(|e| e.evidence.name.clone()).collect();
                    match model.add(effects, &present, &tried) {
                        Ok(Addition::Added(fitted)) => present = *fitted,
                        Ok(Addition::Rejected(found_possible)) => {
                            possible.retain(|p| p.spec.name != found.name);
                            possible.extend(found_possible);
                            conclude(&mut rounds, RoundOutcome::NoHeldOutGain);
                            rejected.push(found.name.clone());
                            tried.extend((1..=names.len()).map(|n| names[..n].iter().cloned().collect()));
                            unchanged = Some(examination);
                            continue;
                        }
                        Err(error) => {
                            conclude(&mut rounds, RoundOutcome::NotFitted { error: error.to_string() });
                            rejected.push(found.name.clone());
                            tried.extend((1..=names.len()).map(|n| names[..n].iter().cloned().collect()));
                            unchanged = Some(examination);
                            continue;
                        }
                    }
                    largest_share = largest_share.max(merit(found) / examination.cost());
                    rejected.clear();
                    tried.clear();
                    let effects = model.added[before..].iter().map(|a| a.evidence.spec.clone()).collect();
                    let removed = model.remove_unnecessary(&mut present, before, examination.tests)?;
                    conclude(&mut rounds, RoundOutcome::Added { effects, removed });
                    if model.exclude_bad_frames(&mut present.fit, &mut bad_frames, 0.0)? {
                        // Errors before and after have to be about the same frames.
                        first = model.fitted(model.declared())?;
                        present.held_out = model.held_out(&present.fit, &model.present())?;
                        model.update_errors(0, &present.held_out)?;
                    }
                }
            }
        };
        if let Some(fitted) = formula_instead(&mut model, &first, &present, thresholds)? {
            largest_share = share_of_last(&model, first.fit.cost);
            present = fitted;
            rejected.clear();
            tried.clear();
            continue;
        }
        // Functions of two covariates together show in no free function of one.
        let searched = !left_over.is_empty() || formula_refused.is_some();
        if !options.formulas
            || searched
            || model.formulas.len() >= MOST_FORMULAS
            || rounds.len() >= thresholds.most_rounds
        {
            break examination;
        }
        model.report("searching a formula", &model.present());
        match find_formula(&mut model, &examination, &present, Chance::Residuals, thresholds)? {
            Ok((_, fitted)) => {
                largest_share = largest_share.max(share_of_last(&model, examination.cost()));
                present = fitted;
                rejected.clear();
                tried.clear();
                model.remove_unnecessary(&mut present, 0, examination.tests)?;
            }
            Err(Refused { reason, together }) => {
                formula_refused = Some(reason);
                left_over.extend(together.as_ref().map(LeftOver::together));
                break examination;
            }
        }
    };
    if !model.added.is_empty() && model.readmit(&whole, &mut bad_frames)? {
        present = model.fitted(&model.present())?;
        first = model.fitted(model.declared())?;
        model.update_errors(0, &present.held_out)?;
    }
    model.report("looking for what to capture next", &model.present());
    // While effects were looked for, what changes from frame to frame was no excuse; the numbers that are reported cover it.
    present.fit = with_frame_scatter(present.fit);
    let steps = steps(&model, &first.held_out, &present.fit)?;
    let (fit, present) = (present.fit, present.held_out);
    let planes = frame_planes(&fit);
    let share = share_with_own_plane(&planes, thresholds);
    if share > thresholds.many_own_planes {
        left_over.push(LeftOver::frame_planes(&planes, share));
    }
    possible.retain(|p| fit.camera.block(&p.spec.name).is_none());
    model.report("comparing frames", &model.present());
    let pure_error = pure_error(&fit, thresholds);
    let shared = pure_error.as_ref().and_then(|p| LeftOver::shared(p, &left_over, thresholds));
    left_over.extend(shared);
    let in_steps = |f: &&Discovery| steps.iter().any(|s| s.spec.name == f.effect.name());
    let mut formulas: Vec<Discovery> = model.formulas.iter().filter(in_steps).cloned().collect();
    for formula in &mut formulas {
        formula.components = components(&fit, &formula.effect, formula.place.of);
    }
    let is_candidate = formulas.iter().any(|formula| !formula.confirmed);
    let verdict = match (left_over.is_empty() && !is_candidate, steps.is_empty()) {
        (false, _) => Verdict::Unexplained,
        (true, false) => Verdict::Effect,
        (true, true) => Verdict::Adequate,
    };
    let mut capture_next = distinguishing_frames(&fit, register, &steps, thresholds);
    for (formula, step) in
        formulas.iter().filter_map(|f| Some((f, steps.iter().find(|s| s.spec.name == f.effect.name())?)))
    {
        capture_next.extend(frames_against_rivals(&fit, model.register(), step, formula, thresholds));
    }
    capture_next.extend(missing_covariates(&fit, register, thresholds));
    Ok(Diagnosis {
        verdict,
        steps,
        possible,
        pure_error,
        rounds,
        bad_frames,
        declarations,
        left_over,
        formulas,
        formula_refused,
        capture_next,
        first: first.fit,
        last: fit,
        before: first.held_out,
        after: present,
        planes,
        examination,
    })
}

/// Merit of the effect that was added last, as a share of the cost before it.
fn share_of_last(model: &AugmentedModel<'_>, cost: f64) -> f64 {
    model.added.last().map_or(0.0, |added| merit(&added.evidence) / cost)
}

/// Searches a formula for what the present model leaves and adds it; else the reason why there is none.
fn find_formula(
    model: &mut AugmentedModel<'_>,
    examination: &Examination,
    present: &Fitted,
    chance: Chance<'_>,
    thresholds: &Thresholds,
) -> Result<Result<(PieceSpec, Fitted), Refused>, DiagnoseError> {
    let taken: Vec<String> = present.fit.camera.blocks().iter().map(|block| block.name().to_owned()).collect();
    let verify = model.verify_under(&present.fit);
    let discovery = match discovery::search(&present.fit, chance, verify.as_ref(), examination, &taken, thresholds) {
        Search::Found(discovery) => discovery,
        Search::Nothing(refused) => {
            info!("no formula: {}", refused.reason);
            return Ok(Err(refused));
        }
    };
    let (spec, text) = (discovery.effect.spec(), discovery.effect.text());
    Ok(match model.add_formula(*discovery, present)? {
        Some(fitted) => Ok((spec, fitted)),
        None => Err(Refused {
            reason: format!("{text} does not lower the error on left-out frames for certain"),
            together: None,
        }),
    })
}

/// A formula instead of all effects that were added, where it alone is certainly better on left-out frames: effects of the catalogue can
/// imitate an error that the catalogue lacks. `None` where there is none, and where formulas are among the effects already.
fn formula_instead(
    model: &mut AugmentedModel<'_>,
    first: &Fitted,
    present: &Fitted,
    thresholds: &Thresholds,
) -> Result<Option<Fitted>, DiagnoseError> {
    if !model.options.formulas || model.added.is_empty() || model.compared_with_formula {
        return Ok(None);
    }
    model.compared_with_formula = true;
    model.report("searching a formula instead", model.declared());
    // With the noise that the effects leave: under the declared model what it lacks counts as noise, most where noise is least.
    let fit = &Calibrated { noise: present.fit.noise, ..first.fit.clone() };
    let examination = examine(fit, &model.declared().register, thresholds)?;
    let taken: Vec<String> = present.fit.camera.blocks().iter().map(|block| block.name().to_owned()).collect();
    let verify = model.verify_under(fit);
    let chance = Chance::Complete(&present.fit);
    match discovery::search(fit, chance, verify.as_ref(), &examination, &taken, thresholds) {
        Search::Found(discovery) => Ok(model.replace_by_formula(*discovery, first, present)?),
        Search::Nothing(refused) => {
            info!("no formula instead: {}", refused.reason);
            Ok(None)
        }
    }
}

/// Most formulas of a diagnosis.
const MOST_FORMULAS: usize = 2;

/// Decides on an examination; effects of one covariate are refuted where a free function of it explains much more, and those of the lens
/// where something remains unexplained and images alone do not show them. The decision is made without them.
fn decide_without_refuted(
    fit: &Calibrated,
    examination: &Examination,
    least_share: f64,
    [rejected, hidden]: [&[String]; 2],
    options: &DiagnoseOptions,
) -> Result<(Decision, Vec<Refuted>), DiagnoseError> {
    let (register, thresholds) = (&options.calibrate.register, &options.thresholds);
    let planes = frame_planes(fit);
    let is_hidden = |i: &usize| hidden.contains(&examination.evidence[*i].name);
    let mut refuted: Vec<Refuted> = (0..examination.evidence.len())
        .filter(is_hidden)
        .map(|effect| Refuted { effect, because: Refutation::NotInImages })
        .collect();
    loop {
        let places: Vec<usize> = refuted.iter().map(|r| r.effect).collect();
        let decision = decide(examination, &planes, least_share, rejected, &places, thresholds);
        let (members, leaves_unexplained) = match &decision {
            Decision::Add { effect, jointly_with, leaves_unexplained, .. } => {
                (std::iter::once(effect).chain(jointly_with).copied().collect(), *leaves_unexplained)
            }
            Decision::Nothing | Decision::Unexplained { .. } => (Vec::<usize>::new(), false),
        };
        let before = refuted.len();
        for member in &members {
            let others: Vec<&Evidence> =
                members.iter().filter(|m| *m != member).map(|m| &examination.evidence[*m]).collect();
            let (states, effect) = (&examination.states, &examination.evidence[*member]);
            if leaves_unexplained && !shows_in_images(fit, register, effect, &others, thresholds)? {
                refuted.push(Refuted { effect: *member, because: Refutation::NotInImages });
                continue;
            }
            let share = share_of_own_function(fit, register, states, effect, &others, thresholds)?;
            let small = share.filter(|(_, share)| *share < thresholds.least_explained_of_own);
            refuted.extend(small.map(|(along, explained)| Refuted {
                effect: *member,
                because: Refutation::OwnFunction { along, explained },
            }));
        }
        if refuted.len() == before {
            return Ok((decision, refuted));
        }
    }
}

/// Share of the cost that effects must be predicted to explain to be tried: that of half the fall of the held-out error that they would
/// have to bring, because predictions are uncertain. In a thousand frames much less is significant.
fn least_share_worth_a_trial(thresholds: &Thresholds) -> f64 {
    // An error that falls by p per cent leaves (1 − p / 100)² of the cost.
    let fall = 0.5 * thresholds.least_held_out_gain_percent / 100.0;
    1.0 - (1.0 - fall).powi(2)
}

/// Records what came of the last round's decision.
fn conclude(rounds: &mut [Round], outcome: RoundOutcome) {
    if let Some(last) = rounds.last_mut() {
        last.outcome = Some(outcome);
    }
}

/// The effect that was found and those that explain the residuals together with it, in order. The p-value of each is given
/// those before it; each lists the names of itself and those after it.
fn effects_to_add(
    examination: &Examination,
    effect: usize,
    jointly_with: &[usize],
    indistinguishable: &[String],
    present: &HeldOut,
) -> Vec<AddedEffect> {
    let members: Vec<usize> = std::iter::once(effect).chain(jointly_with.iter().copied()).collect();
    (0..members.len())
        .map(|i| {
            let evidence = examination.evidence[members[i]].clone();
            let p_value = match i {
                0 => evidence.p_value,
                _ => score_given(examination, members[i], &members[..i]).1,
            };
            AddedEffect {
                effects: members[i..].iter().map(|m| examination.evidence[*m].name.clone()).collect(),
                indistinguishable: if i == 0 { indistinguishable.to_vec() } else { Vec::new() },
                placements_not_told_apart: Vec::new(),
                p_value: (p_value * examination.tests as f64).min(1.0),
                after: present.clone(),
                evidence,
            }
        })
        .collect()
}
