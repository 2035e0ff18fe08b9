//! A model on trial: fits, errors on frames that the fit did not see, effects added and taken out again, frames left out.

use tracing::info;

use super::account::{fitted_block, fitted_parameters};
use super::decision::significant;
use super::evidence::{Evidence, refined, weigh_alone};
use super::frames::{BadFrame, FramePlane, explain, frame_planes, outlying};
use super::probe::Along;
use super::sight::Sights;
use super::{FREE_MAP, GROSS_MM, HeldOut, Step};
use crate::calibrate::{CalibrateError, CalibrateOptions, Calibrated, calibrate};
use crate::judge::cross_validation::{
    cross_validate, depth_gain_percent, depth_rms_interval, errors, weighted_depth_rms,
};
use crate::judge::evaluate::evaluate;
use crate::observe::noise::DepthNoise;
use crate::observe::{Capture, DetectedFrame};
use crate::progress::Job;

/// The forms of the free map that are tried: an offset of inverse depth alone, and with a scale.
const MAPS: [&str; 2] = [FREE_MAP, "bspline@columns=6@rows=6"];
/// Where the residuals follow rows or columns of the image alone, finer ones across.
const ROWS: &str = "free_map@columns=4@rows=48";
const COLUMNS: &str = "free_map@columns=64@rows=4";
/// What is gained where noise is small must not cost more than this where it is large, per cent of the depth error.
const MOST_LOSS_PERCENT: f64 = 0.5;
/// Less than this on held-out frames is nothing, per cent.
const LEAST_GAIN_PERCENT: f64 = 0.02;
/// The depth model beside which bad frames stand out where the declared one follows them.
const STIFF: &str = "projective:w";
/// Rounds of leaving bad frames out.
const FRAME_ROUNDS: usize = 3;

/// A fit and its errors on frames that it did not see.
#[derive(Clone)]
pub(super) struct Fitted {
    pub fit: Calibrated,
    pub held_out: HeldOut,
}

/// An effect that the loop added, or the free map.
#[derive(Clone)]
pub(super) struct Added {
    /// Its evidence in the round in which it was found, with its constant as searched since.
    pub evidence: Evidence,
    /// Names that explain together, it first.
    pub effects: Vec<String>,
    pub indistinguishable: Vec<String>,
    /// p-value, corrected for the number of effects tested.
    pub p_value: f64,
    /// The model with it and those before it on frames that it did not see.
    pub after: HeldOut,
}

/// The declared model, what was added to it, and what it is tried on.
pub(super) struct Trial<'a> {
    pub capture: Capture,
    pub verify: Option<&'a Capture>,
    pub declared: CalibrateOptions,
    pub folds: usize,
    pub added: Vec<Added>,
    /// The round of the loop, from 1; 0 is what comes before.
    pub round: usize,
    job: Box<dyn Job>,
}

impl<'a> Trial<'a> {
    /// The declared model, with nothing added.
    pub fn new(capture: Capture, verify: Option<&'a Capture>, declared: CalibrateOptions, folds: usize) -> Self {
        let job = declared.progress.open_ended("diagnosing");
        Self { capture, verify, declared, folds, added: Vec::new(), round: 0, job }
    }

    /// Says on terminals what is being done now, and with which model.
    pub fn doing(&self, what: &str, options: &CalibrateOptions) {
        let added = options.effects.get(self.declared.effects.len()..).unwrap_or_default();
        let model = if added.is_empty() { "the declared model".to_owned() } else { added.join(" + ") };
        match self.round {
            0 => self.job.doing(format!("diagnosing: {what} ({model})")),
            round => self.job.doing(format!("diagnosing, round {round}: {what} ({model})")),
        }
    }

    /// The declared model with effects added.
    fn options(&self, added: &[Added]) -> CalibrateOptions {
        let mut options = self.declared.clone();
        options.effects.extend(added.iter().map(|a| a.evidence.spec.clone()));
        options
    }

    /// The present model.
    pub fn present(&self) -> CalibrateOptions {
        self.options(&self.added)
    }

    /// Fits a model.
    pub fn fit(&self, options: &CalibrateOptions) -> Result<Calibrated, CalibrateError> {
        self.doing("fitting", options);
        calibrate(&self.capture, options)
    }

    /// Fits the declared model. Frames with depth that is not theirs can bend it until it folds; a scale of depth alone does not
    /// bend, so that they stand out beside it, and are left out.
    pub fn fit_declared(&mut self, bad_frames: &mut Vec<BadFrame>) -> Result<Calibrated, CalibrateError> {
        let error = match self.fit(&self.declared) {
            Err(error) if error.is_untrusted_fit() => error,
            other => return other,
        };
        let stiff = CalibrateOptions { model: STIFF.to_owned(), effects: Vec::new(), ..self.declared.clone() };
        let Ok(fit) = self.fit(&stiff) else { return Err(error) };
        let planes = frame_planes(&fit);
        let bad = outlying(&planes, GROSS_MM);
        if bad.is_empty() {
            return Err(error);
        }
        info!("{error}: tried again without {} frames", bad.len());
        self.leave_out(&fit, &bad, bad_frames);
        self.fit(&self.declared)
    }

    /// Errors on frames that the model did not see.
    pub fn held_out(&self, fit: &Calibrated, options: &CalibrateOptions) -> Result<HeldOut, CalibrateError> {
        self.doing("judging on held-out frames", options);
        let evaluated = match self.verify {
            Some(verify) => evaluate(&fit.camera, verify),
            None => cross_validate(&fit.capture.detected(), self.folds.min(fit.capture.frames.len()), options)?,
        };
        Ok(HeldOut { errors: errors(&evaluated), evaluated })
    }

    /// Fit and errors.
    pub fn fitted(&self, options: &CalibrateOptions) -> Result<Fitted, CalibrateError> {
        let fit = self.fit(options)?;
        Ok(Fitted { held_out: self.held_out(&fit, options)?, fit })
    }

    /// Adds effects that explain together, as few of them as bring something on held-out frames: of two that cancel in part,
    /// one alone does not. `None`, and nothing is added, where all of them bring nothing.
    pub fn add(&mut self, found: Vec<Added>, present: &Fitted) -> Result<Option<Fitted>, CalibrateError> {
        let before = self.added.clone();
        for one in found {
            match self.add_one(one) {
                Ok(fitted) if improves(&present.held_out, &fitted.held_out, &fitted.fit.noise.depth) => {
                    return Ok(Some(fitted));
                }
                Ok(_) => {}
                Err(error) if self.added.len() == before.len() => return Err(error),
                // Beside the first, another one cannot be fitted.
                Err(error) => {
                    info!("{error}");
                    break;
                }
            }
        }
        self.added = before;
        Ok(None)
    }

    /// Adds an effect to the model, fits it, searches the constants of all that were added again beside everything fitted, and
    /// fits once more. Where it cannot be fitted the model stays as it was.
    fn add_one(&mut self, found: Added) -> Result<Fitted, CalibrateError> {
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

    fn fit_with_constants(&mut self) -> Result<Fitted, CalibrateError> {
        let reduced = self.added.last().and_then(|last| last.evidence.reduced.clone());
        let mut fit = match (self.fit(&self.present()), reduced) {
            // The data see fewer combinations than it has parameters: hold those that they see least of.
            (Err(CalibrateError::Undetermined(_)), Some(reduced)) => {
                if let Some(last) = self.added.last_mut() {
                    last.evidence.spec = reduced;
                }
                self.fit(&self.present())?
            }
            (other, _) => other?,
        };
        for i in (0..self.added.len()).rev() {
            if let Some(finer) = refined(&fit, &self.declared.register, &self.added[i].evidence) {
                self.added[i].evidence = finer;
                fit = self.fit(&self.present())?;
            }
        }
        Ok(Fitted { held_out: self.held_out(&fit, &self.present())?, fit })
    }

    /// Takes out what those that were added later have made needless: an effect that resembles two others is found before
    /// them. Returns the specs.
    pub fn take_out_needless(&mut self, present: &mut Fitted, tests: usize) -> Result<Vec<String>, CalibrateError> {
        let mut out = Vec::new();
        let mut i = 0;
        while i + 1 < self.added.len() {
            let mut rest = self.added.clone();
            let one = rest.remove(i);
            let options = self.options(&rest);
            match self.fitted(&options) {
                Ok(without) if !self.is_needed(&one, &without, present, tests) => {
                    out.push(one.evidence.spec);
                    self.added = rest;
                    *present = without;
                    self.errors_along(i, &present.held_out)?;
                }
                Ok(_) => i += 1,
                Err(error) => {
                    info!("without {}: {error}", one.evidence.spec);
                    i += 1;
                }
            }
        }
        Ok(out)
    }

    /// Whether an effect brings something beside the others on held-out frames, and is significant.
    fn is_needed(&self, one: &Added, without: &Fitted, with: &Fitted, tests: usize) -> bool {
        let alone = weigh_alone(&without.fit, &self.declared.register, &one.evidence.spec);
        let counts = alone.is_none_or(|(score, gains)| significant(score.p_value, tests, &gains));
        counts && improves(&without.held_out, &with.held_out, &with.fit.noise.depth)
    }

    /// Fits the models along the way again, from the effect at `first` on; the last of them is the `present` one.
    pub fn errors_along(&mut self, first: usize, present: &HeldOut) -> Result<(), CalibrateError> {
        for i in first..self.added.len() {
            let is_last = i + 1 == self.added.len();
            self.added[i].after =
                if is_last { present.clone() } else { self.fitted(&self.options(&self.added[..=i]))?.held_out };
        }
        Ok(())
    }

    /// What was added, as the present model has it.
    pub fn steps(&self, declared: &HeldOut, fit: &Calibrated) -> Vec<Step> {
        let sights = Sights::of(fit);
        let befores = std::iter::once(declared).chain(self.added.iter().map(|a| &a.after));
        let step = |(one, before): (&Added, &HeldOut)| {
            let name = &one.evidence.name;
            // A map's values at its nodes are no findings, and D takes up parts of them.
            let (parameters, size_mm) = if name == FREE_MAP {
                (Vec::new(), one.evidence.expected_size_mm)
            } else {
                (fitted_parameters(fit, name), sights.size_mm(fitted_block(fit, name)))
            };
            Step {
                effects: one.effects.clone(),
                spec: one.evidence.spec.clone(),
                indistinguishable: one.indistinguishable.clone(),
                parameters,
                size_mm,
                p_value: one.p_value,
                before: before.errors,
                after: one.after.errors,
                depth_rms_after_mm: depth_rms_interval(&one.after.evaluated),
                gain_percent: depth_gain_percent(&before.evaluated, &one.after.evaluated),
            }
        };
        self.added.iter().zip(befores).map(step).collect()
    }

    /// Adds the free map in the form that brings most on held-out frames; it names nothing but corrects. Where no form brings
    /// anything the model stays as it is.
    pub fn add_free_map(&mut self, found: &Evidence, present: &mut Fitted, p_value: f64) {
        let across = match found.along {
            Some(Along::Row) => Some(ROWS),
            Some(Along::Column) => Some(COLUMNS),
            _ => None,
        };
        let rms = |h: &HeldOut| h.errors.depth_rms_mm.unwrap_or(f64::INFINITY);
        let mut best: Option<(&str, Fitted)> = None;
        for spec in MAPS.into_iter().chain(across) {
            let mut options = self.present();
            options.effects.push(spec.to_owned());
            let fitted = match self.fitted(&options) {
                Ok(fitted) => fitted,
                Err(error) => {
                    info!("{spec} cannot be fitted: {error}");
                    continue;
                }
            };
            let lowest = rms(&best.as_ref().map_or(&*present, |(_, b)| b).held_out);
            let better = improves(&present.held_out, &fitted.held_out, &fitted.fit.noise.depth);
            if better && rms(&fitted.held_out) < lowest {
                best = Some((spec, fitted));
            }
        }
        let Some((spec, fitted)) = best else { return };
        self.added.push(Added {
            evidence: Evidence { name: FREE_MAP.to_owned(), spec: spec.to_owned(), ..found.clone() },
            effects: vec![FREE_MAP.to_owned()],
            indistinguishable: Vec::new(),
            p_value,
            after: fitted.held_out.clone(),
        });
        *present = fitted;
    }

    /// Takes frames back that were left out before the effects were in the model which explain them. Returns whether there
    /// were any.
    pub fn readmit(&mut self, whole: &Capture, bad_frames: &mut Vec<BadFrame>) -> Result<bool, CalibrateError> {
        let out = |f: &DetectedFrame| bad_frames.iter().any(|b| b.name == f.name);
        if !whole.frames.iter().any(out) {
            return Ok(false);
        }
        let all = Capture { dropped: self.capture.dropped.clone(), ..whole.clone() };
        let planes = frame_planes(&calibrate(&all, &self.present())?);
        let still = outlying(&planes, 0.0);
        let back = |b: &BadFrame| {
            planes.iter().any(|p| p.name == b.name && p.p_value.is_finite()) && !still.iter().any(|p| p.name == b.name)
        };
        let returned: Vec<String> = bad_frames.iter().filter(|b| back(b)).map(|b| b.name.clone()).collect();
        bad_frames.retain(|b| !returned.contains(&b.name));
        self.capture = without(whole, bad_frames);
        Ok(!returned.is_empty())
    }

    fn leave_out(&mut self, fit: &Calibrated, bad: &[&FramePlane], bad_frames: &mut Vec<BadFrame>) {
        bad_frames.extend(explain(fit, bad));
        self.capture = without(&self.capture, bad_frames);
    }

    /// Leaves bad frames out until there are none. Returns whether there were any.
    pub fn drop_bad_frames(
        &mut self,
        fit: &mut Calibrated,
        bad_frames: &mut Vec<BadFrame>,
        least_mm: f64,
    ) -> Result<bool, CalibrateError> {
        let before = bad_frames.len();
        for _ in 0..FRAME_ROUNDS {
            self.doing("looking for bad frames", &self.present());
            let planes = frame_planes(fit);
            let bad = outlying(&planes, least_mm);
            if bad.is_empty() {
                break;
            }
            self.leave_out(fit, &bad, bad_frames);
            *fit = self.fit(&self.present())?;
        }
        Ok(bad_frames.len() > before)
    }
}

fn without(capture: &Capture, bad_frames: &[BadFrame]) -> Capture {
    capture.subset(|_, f| bad_frames.iter().all(|b| b.name != f.name))
}

/// Whether a model is better than another on held-out frames: in depth, weighted by the noise, and in the image taken
/// together. What one gains the other must not lose; nor must far pixels lose, where noise is large, what near ones gain,
/// unless that may be chance over the frames and is less than the gain.
fn improves(before: &HeldOut, after: &HeldOut, noise: &DepthNoise) -> bool {
    let gain = |b: f64, a: f64| if b > 0.0 { 100.0 * (1.0 - a / b) } else { 0.0 };
    let weighted = |h: &HeldOut| weighted_depth_rms(&h.evaluated, noise);
    let depth = weighted(before).zip(weighted(after)).map_or(0.0, |(b, a)| gain(b, a));
    let image = gain(before.errors.reprojection_px, after.errors.reprojection_px);
    let loses = || {
        depth_gain_percent(&before.evaluated, &after.evaluated).is_some_and(|plain| {
            let by_chance = plain.high > 0.0 && depth > -plain.value;
            plain.value < -MOST_LOSS_PERCENT && !by_chance
        })
    };
    depth + image > LEAST_GAIN_PERCENT && !loses()
}

#[cfg(test)]
mod tests {
    use depthcal_simulate::{CameraTruth, Effect, Kind, PointOptions, Simulation};

    use super::super::evidence::examine;
    use super::*;
    use crate::observe::MeasuredDepth;
    use crate::simulated;

    #[test]
    fn needless_effects_are_taken_out_and_the_others_kept() {
        let effect = Effect::new("cyclic_depth", 4.0).unwrap();
        let simulation = Simulation::new(CameraTruth::published(1).unwrap(), Kind::General(1), &[effect], 5);
        let capture = simulated::capture(&simulation.observe_points(&PointOptions::default()).unwrap());
        let declared = CalibrateOptions::default();
        let mut trial = Trial::new(capture, None, declared, 5);
        let first = trial.fitted(&trial.present()).unwrap();
        let examination = examine(&first.fit, &trial.declared.register).unwrap();
        let found = |name: &str| {
            let evidence = examination.effects().find(|e| e.name == name).unwrap().clone();
            let effects = vec![name.to_owned()];
            Added { evidence, effects, indistinguishable: Vec::new(), p_value: 0.0, after: first.held_out.clone() }
        };
        for name in ["incidence_bias", "cyclic_depth", "radial_range"] {
            trial.add_one(found(name)).unwrap();
        }
        let mut present = trial.fitted(&trial.present()).unwrap();
        // The last one was added just now: the loop has tested that.
        let out = trial.take_out_needless(&mut present, examination.tests).unwrap();
        assert_eq!(out, ["incidence_bias"]);
        let names: Vec<&str> = trial.added.iter().map(|a| a.evidence.name.as_str()).collect();
        assert_eq!(names, ["cyclic_depth", "radial_range"]);
        // Every step goes on where the one before ended, on the models that are left.
        let steps = trial.steps(&first.held_out, &present.fit);
        assert_eq!(steps[0].before, first.held_out.errors);
        assert_eq!(steps[1].before, steps[0].after);
        assert_eq!(steps[1].after, present.held_out.errors);
        assert!(steps[0].after.depth_rms_mm < steps[0].before.depth_rms_mm);
    }

    /// Depth of the nearest and of the farthest board, exchanged.
    #[test]
    fn frames_that_bend_the_declared_model_until_it_folds_are_left_out() {
        let mut folded = 0;
        for seed in 0..6 {
            let simulation = Simulation::new(CameraTruth::published(1).unwrap(), Kind::General(1), &[], 1100 + seed);
            let mut capture = simulated::capture(&simulation.observe_points(&PointOptions::default()).unwrap());
            let mean = |f: &DetectedFrame| match &f.depth {
                MeasuredDepth::Pixels(pixels) => pixels.iter().map(|p| p.depth_mm).sum::<f64>() / pixels.len() as f64,
                _ => f64::NAN,
            };
            capture.frames.sort_by(|a, b| mean(a).total_cmp(&mean(b)));
            let last = capture.frames.len() - 1;
            for i in 0..2 {
                let near = std::mem::take(&mut capture.frames[i].depth);
                capture.frames[i].depth = std::mem::replace(&mut capture.frames[last - i].depth, near);
            }
            let exchanged = [0, 1, last - 1, last].map(|i| capture.frames[i].name.clone());
            let declared = CalibrateOptions::default();
            folded += usize::from(calibrate(&capture, &declared).is_err_and(|e| e.is_untrusted_fit()));
            let mut trial = Trial::new(capture, None, declared, 5);
            let mut bad_frames = Vec::new();
            let mut fit = trial.fit_declared(&mut bad_frames).unwrap();
            trial.drop_bad_frames(&mut fit, &mut bad_frames, GROSS_MM).unwrap();
            assert!(exchanged.iter().all(|n| bad_frames.iter().any(|b| b.name == *n)), "seed {seed}: {bad_frames:?}");
            assert_eq!(bad_frames.len(), exchanged.len(), "seed {seed}: {bad_frames:?}");
        }
        assert!(folded > 0, "no capture bends the model: the test shows nothing");
    }
}
