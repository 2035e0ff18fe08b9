//! The declared model with the effects that the loop has added: fits, held-out errors, effects added and removed.

use std::cell::RefCell;
use std::collections::BTreeSet;

use depthcal_model::{Covariate, Modulation, PieceSpec, Placement, Register};
use depthcal_statistics::mean_to_standard_error;
use nalgebra::{DMatrix, DVector};
use tracing::info;

use super::discovery::Discovery;
use super::evidence::Evidence;
use super::examination::test_effect;
use super::held_out::{Gain, HeldOut, gain};
use super::merit::significant;
use super::modulation_search::promising_modulations;
use super::options::DiagnoseOptions;
use super::possible::Possible;
use super::thresholds::Thresholds;
use super::variant_search::{Refined, refined_variant};
use crate::calibrate::{
    CalibrateError, CalibrateOptions, Calibrated, calibrate_keeping_samples, has_fields, light_of_samples, readjust,
    sampled_under,
};
use crate::judge::cross_validation::{cross_validate_thinned, errors, weighted_gain_percent};
use crate::judge::evaluate::evaluate;
use crate::judge::parts::Parts;
use crate::observe::{Capture, SampledFrame};
use crate::progress::Job;

/// A fit and its errors on frames that it did not see.
#[derive(Clone)]
pub(super) struct Fitted {
    pub fit: Calibrated,
    pub held_out: HeldOut,
}

/// An effect that the loop has added, or the free map.
#[derive(Clone)]
pub(super) struct AddedEffect {
    /// Its evidence in the round in which it was found, with the value of its constant as searched since.
    pub evidence: Evidence,
    /// Names of the effects that explained the residuals together, this one first.
    pub effects: Vec<String>,
    /// Effects that the captures cannot distinguish from it.
    pub indistinguishable: Vec<String>,
    /// Its other places and forms that the captures cannot distinguish from the one it has.
    pub placements_not_told_apart: Vec<Placement>,
    /// p-value, corrected for the number of effects tested.
    pub p_value: f64,
    /// Held-out errors of the model with it and those before it.
    pub after: HeldOut,
}

/// The declared model, the effects added to it, and the frames that it is fitted to.
pub(super) struct AugmentedModel<'a> {
    /// The frames, without those that were excluded.
    pub capture: Capture,
    /// Another dataset that verifies the model; without it held-out errors come from cross-validation.
    pub verify: Option<&'a Capture>,
    /// Declared model, folds and thresholds.
    pub options: &'a DiagnoseOptions,
    /// The added effects, in order.
    pub added: Vec<AddedEffect>,
    /// The formulas that were found, whether they are still among the effects or not.
    pub formulas: Vec<Discovery>,
    /// Whether a formula has been compared with the added effects.
    pub compared_with_formula: bool,
    /// The round of the loop, from 1; 0 before the loop.
    pub round: usize,
    job: Box<dyn Job>,
    basis: RefCell<Option<Basis>>,
}

/// Most board pixels of a frame, about, on which models are judged with frames left out singly …
const JUDGED_PIXELS: usize = 16_000;
/// … and in blocks, which only decide.
const JUDGED_PIXELS_OF_BLOCKS: usize = 2000;

/// What an effect must be predicted to explain to be kept without a fit, over what one must explain to be plainly needed: a Wald statistic
/// takes residuals of a frame for independent, and is quadratic.
const WALD_FACTOR: f64 = 5.0;

/// What fits start from.
struct Basis {
    /// All frames that a fit has used, with their depth samples, before any were left out as outliers of a model.
    samples: Capture<SampledFrame>,
    /// The last fit.
    last: Calibrated,
    /// Modulation frequencies for which the samples have the light of their frames.
    light: Option<Modulation>,
}

impl Basis {
    /// The samples of the frames of a capture; `None` where it has frames that were never sampled.
    fn samples_of(&self, capture: &Capture) -> Option<Capture<SampledFrame>> {
        let (frames, dropped) = (&self.samples.frames, &self.samples.dropped);
        let known = |name: &str| frames.iter().any(|f| f.name == name) || dropped.iter().any(|d| d.name == name);
        let wanted = |name: &str| capture.frames.iter().any(|f| f.name == name);
        capture.frames.iter().all(|f| known(&f.name)).then(|| self.samples.subset(|_, f| wanted(&f.name)))
    }
}

/// What came of effects that were tried.
pub(super) enum Addition {
    /// They are in the model, which was fitted.
    Added(Box<Fitted>),
    /// They are not; the first of them may be missing, where it is possible.
    Rejected(Option<Possible>),
}

impl<'a> AugmentedModel<'a> {
    /// The declared model, with nothing added.
    pub fn new(capture: Capture, verify: Option<&'a Capture>, options: &'a DiagnoseOptions) -> Self {
        let job = options.calibrate.progress.open_ended("diagnosing");
        Self {
            capture,
            verify,
            options,
            added: Vec::new(),
            formulas: Vec::new(),
            compared_with_formula: false,
            round: 0,
            job,
            basis: RefCell::default(),
        }
    }

    /// Options of the declared model.
    pub fn declared(&self) -> &'a CalibrateOptions {
        &self.options.calibrate
    }

    /// Thresholds of the rules.
    pub fn thresholds(&self) -> &'a Thresholds {
        &self.options.thresholds
    }

    /// Reports to the progress what is being done, and with which model.
    pub fn report(&self, what: &str, model: &CalibrateOptions) {
        let added = model.effects.get(self.declared().effects.len()..).unwrap_or_default();
        let words: Vec<String> = added.iter().map(|spec| model.register.words(spec)).collect();
        let model = if words.is_empty() { "the declared model".to_owned() } else { words.join(" + ") };
        match self.round {
            0 => self.job.doing(format!("diagnosing: {what} ({model})")),
            round => self.job.doing(format!("diagnosing, round {round}: {what} ({model})")),
        }
    }

    /// The declared register with the formulas that were found.
    pub fn register(&self) -> Register {
        let mut register = self.declared().register.clone();
        for formula in &self.formulas {
            // Their names are free: the search chose them so.
            if let Err(error) = formula.effect.register(&mut register) {
                info!("{error}");
            }
        }
        register
    }

    /// Options of the declared model with effects added.
    fn with_effects(&self, added: &[AddedEffect]) -> CalibrateOptions {
        let mut options = CalibrateOptions { register: self.register(), ..self.declared().clone() };
        options.effects.extend(added.iter().map(|a| a.evidence.spec.clone()));
        options
    }

    /// Options of the present model: the declared one with everything that was added.
    pub fn present(&self) -> CalibrateOptions {
        self.with_effects(&self.added)
    }

    /// Fits a model to the frames.
    ///
    /// The first fit samples the depth; later ones start from the one before, with the same samples.
    pub fn fit(&self, model: &CalibrateOptions) -> Result<Calibrated, CalibrateError> {
        self.report("fitting", model);
        let mut basis = self.basis.borrow_mut();
        let light = light_of_samples(model)?;
        let last = basis.as_ref().filter(|b| b.light == light && !has_fields(model).unwrap_or(false));
        let from_last = last.and_then(|b| Some(readjust(&b.last, b.samples_of(&self.capture)?, model)));
        match (from_last, &mut *basis) {
            (Some(Ok(fit)), Some(basis)) => {
                basis.last = fit.clone();
                return Ok(fit);
            }
            (Some(Err(error @ CalibrateError::Undetermined(_))), _) => return Err(error),
            (Some(Err(error)), _) => info!("from the last fit: {error}; fitted from the start"),
            _ => {}
        }
        let (fit, samples) = calibrate_keeping_samples(&self.capture, model)?;
        *basis = Some(Basis { samples, last: fit.clone(), light });
        Ok(fit)
    }

    /// Held-out errors of a model: those of its fit on the dataset that verifies, or by cross-validation on the frames.
    pub fn held_out(&self, fit: &Calibrated, model: &CalibrateOptions) -> Result<HeldOut, CalibrateError> {
        self.report("judging on held-out frames", model);
        let folds = self.options.folds.min(fit.capture.frames.len());
        let (evaluated, blocks) = match self.verify {
            Some(verify) => (evaluate(&fit.camera, verify), None),
            None => {
                // Models with fields are fitted anew without each part: once has to do.
                let blocks = match has_fields(model)? {
                    true => None,
                    false => Some(cross_validate_thinned(fit, folds, Parts::Blocks, JUDGED_PIXELS_OF_BLOCKS, model)?),
                };
                (cross_validate_thinned(fit, folds, Parts::Interleaved, JUDGED_PIXELS, model)?, blocks)
            }
        };
        Ok(HeldOut { errors: errors(&evaluated), evaluated: evaluated.into(), blocks: blocks.map(Into::into) })
    }

    /// Fit and held-out errors of a model.
    pub fn fitted(&self, model: &CalibrateOptions) -> Result<Fitted, CalibrateError> {
        let fit = self.fit(model)?;
        Ok(Fitted { held_out: self.held_out(&fit, model)?, fit })
    }

    /// What a model brings over another on held-out frames, with depth weighted by the noise of the second; `added` are the effects that
    /// it has more.
    pub fn gain(&self, before: &Fitted, after: &Fitted, added: &[AddedEffect]) -> Gain {
        let is_of_time = |effect: &AddedEffect| {
            let needs = effect.evidence.block.piece().map(|piece| piece.needs()).unwrap_or_default();
            needs.iter().any(|c| matches!(c, Covariate::Time | Covariate::Temperature))
        };
        let of_time = added.iter().any(is_of_time);
        gain(&before.held_out, &after.held_out, &after.fit.noise.depth, of_time, self.thresholds())
    }

    /// Adds effects that explain the residuals together, in the given order and only until the held-out errors fall for certain: of
    /// two effects that cancel each other in part, one alone does not help. Where they do not, nothing is added; the first effect is
    /// possible where they fall with it alone. `tried` are effects that were added together before and did not help.
    pub fn add(
        &mut self,
        found: Vec<AddedEffect>,
        present: &Fitted,
        tried: &[BTreeSet<String>],
    ) -> Result<Addition, CalibrateError> {
        let before = self.added.clone();
        let mut possible = None;
        let mut together = BTreeSet::new();
        for effect in found {
            together.insert(effect.evidence.name.clone());
            if tried.contains(&together) {
                self.added.push(effect);
                continue;
            }
            match self.add_one(effect) {
                Ok(fitted) => match self.gain(present, &fitted, &self.added[before.len()..]) {
                    Gain::Certain => {
                        let last = self.added.len() - 1;
                        for earlier in &mut self.added[..last] {
                            earlier.after = earlier.after.without_pixels();
                        }
                        return Ok(Addition::Added(Box::new(fitted)));
                    }
                    Gain::Possible(gain) if self.added.len() == before.len() + 1 => {
                        let spec = self.added[before.len()].evidence.spec.clone();
                        possible = Some(Possible::new(spec, gain, present.held_out.evaluated.frames.len()));
                    }
                    Gain::Possible(_) | Gain::None => {}
                },
                Err(error) if self.added.len() == before.len() => return Err(error),
                // The first effect can be fitted, but not jointly with this one.
                Err(error) => {
                    info!("{error}");
                    break;
                }
            }
        }
        self.added = before;
        Ok(Addition::Rejected(possible))
    }

    /// Adds an effect, fits the model, refines constants, places and forms of all added effects, and fits again. Where the model cannot be
    /// fitted it stays as it was.
    pub(super) fn add_one(&mut self, found: AddedEffect) -> Result<Fitted, CalibrateError> {
        let before = self.added.clone();
        self.added.push(found);
        let fitted = self.fit_with_constants();
        match &fitted {
            Ok(fitted) => {
                if let Some(last) = self.added.last_mut() {
                    last.after = fitted.held_out.clone();
                }
            }
            Err(_) => self.added = before,
        }
        fitted
    }

    /// Adds a formula, where the held-out errors fall for certain with it.
    pub fn add_formula(&mut self, discovery: Discovery, present: &Fitted) -> Result<Option<Fitted>, CalibrateError> {
        let (name, spec) = (discovery.effect.name().to_owned(), discovery.effect.spec());
        let p_value = discovery.p_value;
        let placements =
            discovery.places_not_told_apart.iter().map(|place| Placement { of: place.of, on: Some(place.on) });
        let placements_not_told_apart = placements.collect();
        self.formulas.push(discovery);
        let register = self.register();
        let tested = test_effect(&present.fit, &register, &spec).zip(register.make(&spec, None).ok());
        let Some((test, block)) = tested else {
            self.formulas.pop();
            return Ok(None);
        };
        let evidence = Evidence {
            name: name.clone(),
            spec,
            value: None,
            reduced: None,
            along: None,
            score: test.score,
            p_value,
            gains: test.gains,
            expected_size_mm: f64::NAN,
            minimal_detectable_mm: f64::NAN,
            block,
            index: 0,
        };
        let effect = AddedEffect {
            evidence,
            effects: vec![name],
            indistinguishable: Vec::new(),
            placements_not_told_apart,
            p_value,
            after: present.held_out.clone(),
        };
        match self.add(vec![effect], present, &[]) {
            Ok(Addition::Added(fitted)) => return Ok(Some(*fitted)),
            Ok(Addition::Rejected(_)) => {}
            Err(error) => info!("a formula cannot be fitted: {error}"),
        }
        self.formulas.pop();
        Ok(None)
    }

    /// The frames that verify, sampled under the camera of a fit; `None` where there are none, or none that show depth.
    pub fn verify_under(&self, fit: &Calibrated) -> Option<Calibrated> {
        let sampled = sampled_under(fit, self.verify?, self.declared());
        sampled.inspect_err(|error| info!("frames that verify cannot be sampled: {error}")).ok()
    }

    /// Puts a formula in the place of all added effects: where the held-out errors with it alone are lower for certain and the effects
    /// lack a part that matters, and where it says the same with less, one formula of fewer parameters for several effects without which the
    /// errors are not lower for certain. A formula that is a special case of an effect always predicts a little better, because it has fewer
    /// parameters: that refutes no name.
    pub fn replace_by_formula(
        &mut self,
        discovery: Discovery,
        first: &Fitted,
        present: &Fitted,
    ) -> Result<Option<Fitted>, CalibrateError> {
        let before = std::mem::take(&mut self.added);
        let Some(fitted) = self.add_formula(discovery, first)? else {
            self.added = before;
            return Ok(None);
        };
        let parameters = |effects: &[AddedEffect]| effects.iter().map(|e| e.evidence.block.theta.len()).sum::<usize>();
        let gained = |fitted: &Fitted| {
            let [without, with] = [first, fitted].map(|f| &f.held_out.evaluated);
            weighted_gain_percent(without, with, &present.fit.noise.depth).map_or(0.0, |gain| gain.value)
        };
        let (of_effects, of_formula) = (gained(present), gained(&fitted));
        let is_better = matches!(self.gain(present, &fitted, &self.added), Gain::Certain)
            && of_effects < self.thresholds().least_explained_of_own * of_formula;
        info!("errors fall by {of_effects:.2} % with the effects, by {of_formula:.2} % with a formula instead");
        let says_it_with_less = before.len() > self.added.len()
            && parameters(&before) > parameters(&self.added)
            && !matches!(self.gain(&fitted, present, &before), Gain::Certain);
        if !(is_better || says_it_with_less) {
            self.formulas.pop();
            self.added = before;
            return Ok(None);
        }
        if let Some(formula) = self.formulas.last_mut() {
            formula.replaced = before.into_iter().map(|effect| effect.evidence.spec).collect();
        }
        Ok(Some(fitted))
    }

    fn fit_with_constants(&mut self) -> Result<Fitted, CalibrateError> {
        let reduced = self.added.last().and_then(|last| last.evidence.reduced.clone());
        let mut fit = match (self.fit(&self.present()), reduced) {
            // The data do not determine all parameters: those that they determine worst are held.
            (Err(CalibrateError::Undetermined(_)), Some(reduced)) => {
                self.set_last_spec(reduced);
                self.fit(&self.present())?
            }
            (other, _) => other?,
        };
        fit = self.with_modulation(fit)?;
        for i in (0..self.added.len()).rev() {
            let AddedEffect { evidence, .. } = &self.added[i];
            let refined = refined_variant(&fit, &self.declared().register, evidence, self.thresholds());
            let Some(Refined { evidence: found, rivals }) = refined else { continue };
            let is_new = found.spec != evidence.spec;
            self.added[i] = AddedEffect { evidence: found, placements_not_told_apart: rivals, ..self.added[i].clone() };
            if is_new {
                fit = self.fit(&self.present())?;
            }
        }
        Ok(Fitted { held_out: self.held_out(&fit, &self.present())?, fit })
    }

    /// Fits the model anew with other modulation frequencies of the effect that was added last, where it depends on them and others explain
    /// more; else `fit` as it is. Frequencies are compared by score tests first, and where one of them explains more than the present ones, the
    /// best by fits and held-out errors: the effect is not linear in the share of the light where pixels are dark.
    fn with_modulation(&mut self, fit: Calibrated) -> Result<Calibrated, CalibrateError> {
        let Some(added) = self.added.last() else { return Ok(fit) };
        let register = &self.declared().register;
        let specs = promising_modulations(&fit, register, &added.evidence, self.thresholds());
        let specs = specs.unwrap_or_else(|error| {
            info!("modulation frequencies are not searched: {error}");
            Vec::new()
        });
        if specs.is_empty() {
            return Ok(fit);
        }
        let noise = fit.noise.depth;
        let present = self.held_out(&fit, &self.present())?;
        let (mut best, mut most) = (added.evidence.spec.clone(), 0.0);
        for spec in specs {
            self.set_last_spec(spec.clone());
            let held_out = match self.fitted(&self.present()) {
                Ok(fitted) => fitted.held_out,
                Err(error) => {
                    info!("{spec}: {error}");
                    continue;
                }
            };
            let gain = weighted_gain_percent(&present.evaluated, &held_out.evaluated, &noise);
            if let Some(gain) = gain.filter(|gain| gain.is_certain() && gain.value > most) {
                (best, most) = (spec, gain.value);
            }
        }
        self.set_last_spec(best);
        self.fit(&self.present())
    }

    fn set_last_spec(&mut self, spec: PieceSpec) {
        if let Some(last) = self.added.last_mut() {
            last.evidence.spec = spec;
        }
    }

    /// Removes effects that later ones have made unnecessary: an effect that resembles two others is found before them. Of those
    /// that were added together, from the one at `together` on, each has to gain for certain given the others: one that is certain must not
    /// carry another that is not. Returns the specs of the removed ones.
    pub fn remove_unnecessary(
        &mut self,
        present: &mut Fitted,
        mut together: usize,
        tests: usize,
    ) -> Result<Vec<PieceSpec>, CalibrateError> {
        let mut removed = Vec::new();
        let mut i = 0;
        while i + 1 < self.added.len() {
            if i < together && self.is_plain_by_wald(&present.fit, &self.added[i]) {
                i += 1;
                continue;
            }
            let mut rest = self.added.clone();
            let effect = rest.remove(i);
            match self.without(&effect, &self.with_effects(&rest), present, i >= together, tests) {
                Ok(Some(without)) => {
                    together -= usize::from(i < together);
                    removed.push(effect.evidence.spec);
                    self.added = rest;
                    *present = without;
                    self.update_errors(i, &present.held_out)?;
                }
                Ok(None) => i += 1,
                Err(error) => {
                    info!("without {}: {error}", effect.evidence.spec);
                    i += 1;
                }
            }
        }
        Ok(removed)
    }

    /// Whether the parameters of an effect alone say that it is plainly needed: half their Wald statistic, which predicts what the cost would
    /// rise by without it, is [`WALD_FACTOR`] times what is asked of a plain effect. Then no fit without it is made.
    fn is_plain_by_wald(&self, fit: &Calibrated, effect: &AddedEffect) -> bool {
        let wald = || {
            let covariance = fit.covariance.as_ref()?;
            let (block, range) = fit.camera.blocks_with_ranges().find(|(b, _)| b.name() == effect.evidence.name)?;
            let free: Vec<usize> = (0..block.theta.len()).filter(|i| block.free[*i]).collect();
            let nominals = block.parameters();
            let change =
                DVector::from_iterator(free.len(), free.iter().map(|i| block.theta[*i] - nominals[*i].nominal));
            let own = DMatrix::from_fn(free.len(), free.len(), |i, j| {
                covariance[(range.start + free[i], range.start + free[j])]
            });
            Some(change.dot(&own.cholesky()?.solve(&change)))
        };
        wald().is_some_and(|wald: f64| 0.5 * wald > WALD_FACTOR * self.thresholds().plain_share * fit.cost)
    }

    /// The fit of `model`, which lacks an effect, where the effect is not needed: it is insignificant given the others, or the model
    /// `with` it is no better on held-out frames, for certain where the effect is `new`.
    fn without(
        &self,
        effect: &AddedEffect,
        model: &CalibrateOptions,
        with: &Fitted,
        is_new: bool,
        tests: usize,
    ) -> Result<Option<Fitted>, CalibrateError> {
        let fit = self.fit(model)?;
        let test = test_effect(&fit, &self.register(), &effect.evidence.spec);
        let thresholds = self.thresholds();
        let counts = test.as_ref().is_none_or(|t| significant(t.score.p_value, tests, &t.gains, thresholds));
        let is_plain = test.as_ref().is_some_and(|t| {
            t.gains.iter().sum::<f64>() > thresholds.plain_share * t.cost
                && mean_to_standard_error(&t.gains) > thresholds.plain_t
        });
        if counts && is_plain && !is_new {
            return Ok(None);
        }
        let without = Fitted { held_out: self.held_out(&fit, model)?, fit };
        let is_needed = match self.gain(&without, with, std::slice::from_ref(effect)) {
            Gain::Certain => counts,
            Gain::Possible(_) => counts && !is_new,
            Gain::None => false,
        };
        Ok((!is_needed).then_some(without))
    }

    /// Computes the held-out errors of the models along the way anew, from the effect at `first` on; those of the last model
    /// are `present`.
    pub fn update_errors(&mut self, first: usize, present: &HeldOut) -> Result<(), CalibrateError> {
        for i in first..self.added.len() {
            let is_last = i + 1 == self.added.len();
            self.added[i].after = if is_last {
                present.clone()
            } else {
                self.fitted(&self.with_effects(&self.added[..=i]))?.held_out.without_pixels()
            };
        }
        Ok(())
    }
}
