//! Closing the loop: fit, look at what is left, find which effect the model lacks, add it, fit again, and report the error
//! before and after on frames that the fit did not see; again until nothing is left that the data can show.
//!
//! | step | where |
//! |---|---|
//! | frames that do not belong | [`frames`] |
//! | which effects may be missing | [`candidates`] |
//! | free functions that compete with them | [`probe`] |
//! | what the residuals say about each | [`evidence`] |
//! | which one to add, if any | [`decision`] |
//! | the loop | here |

pub mod account;
pub mod candidates;
pub mod captures;
pub mod decision;
pub mod evidence;
pub mod frames;
pub mod probe;
pub mod separability;
pub mod sight;

use depthcal_io::{DiagnosisParameter, DiagnosisRound, GainInterval, HeldOutErrors, Verdict};
use depthcal_solver::score::ScoreError;
use thiserror::Error;
use tracing::info;

use crate::calibrate::{CalibrateError, CalibrateOptions, Calibrated, calibrate};
use crate::cross_validation::{cross_validate, depth_gain_percent, errors, weighted_depth_rms};
use crate::evaluate::{Evaluated, evaluate};
use crate::noise::DepthNoise;
use crate::observations::{Capture, Frame};
use decision::{Decision, decide};
use evidence::{Evidence, Examination, examine, refined_spec};
use frames::{BadFrame, FramePlane, explain, frame_planes, outlying, share_with_own_plane, without_duplicates};
use probe::Along;

/// Name of the free map: never a finding, but a correction.
pub const FREE_MAP: &str = "free_map";
/// The forms of it that are tried: an offset of inverse depth alone, and with a scale.
const MAPS: [&str; 2] = [FREE_MAP, "bspline@columns=6@rows=6"];
/// Where the residuals follow rows or columns of the image alone, finer ones across.
const ROWS: &str = "free_map@columns=4@rows=48";
const COLUMNS: &str = "free_map@columns=64@rows=4";
/// What is gained where noise is small must not cost more than this where it is large, per cent of the depth error.
const MOST_LOSS_PERCENT: f64 = 0.5;
/// Effects that bring nothing beside a model before the search ends.
const MOST_REJECTED: usize = 3;
/// What is left after effects were rejected is said when it is at least this share of the residuals' squares.
const WORTH_SAYING: f64 = 0.01;
/// Effects are added at most this often.
const MOST_ROUNDS: usize = 6;
/// An added effect has to bring at least this share of what the effects before it brought.
const WORTH_A_STEP: f64 = 0.06;
/// Before any effect is in the model only frames that are off by this much are left out, mm: a missing effect may look like
/// a smaller one.
const GROSS_MM: f64 = 5.0;
/// Less than this on held-out frames is nothing, per cent.
const LEAST_GAIN_PERCENT: f64 = 0.02;
/// Rounds of leaving bad frames out.
const FRAME_ROUNDS: usize = 3;
/// Share of frames with a plane of their own from which this is a finding.
const MANY_OWN_PLANES: f64 = 0.2;

/// How to diagnose.
#[derive(Debug, Clone)]
pub struct DiagnoseOptions {
    /// The declared model.
    pub calibrate: CalibrateOptions,
    /// Folds of the cross-validation where no other dataset verifies.
    pub folds: usize,
}

impl Default for DiagnoseOptions {
    fn default() -> Self {
        Self { calibrate: CalibrateOptions::default(), folds: 5 }
    }
}

/// Why there is no diagnosis.
#[derive(Debug, Error)]
pub enum DiagnoseError {
    /// The declared model cannot be fitted.
    #[error(transparent)]
    Calibrate(#[from] CalibrateError),
    /// A fit cannot be examined.
    #[error("the fit cannot be examined: {0}")]
    Score(#[from] ScoreError),
    /// Nothing to diagnose.
    #[error("the dataset '{dataset}' has no depth images: a diagnosis needs depth; add frames.depth to dataset.toml")]
    NoDepth {
        /// The dataset.
        dataset: String,
    },
}

/// A model on frames that it was not fitted to.
#[derive(Debug, Clone)]
pub struct HeldOut {
    /// One number per error.
    pub errors: HeldOutErrors,
    /// Frame by frame.
    pub evaluated: Evaluated,
}

/// An effect that was added.
#[derive(Debug, Clone)]
pub struct Step {
    /// Names by falling gain; the first was added.
    pub effects: Vec<String>,
    /// As for `calibrate --with`.
    pub spec: String,
    /// Effects that these captures cannot tell from it.
    pub indistinguishable: Vec<String>,
    /// Its fitted parameters.
    pub parameters: Vec<DiagnosisParameter>,
    /// Root mean square size over the observations, mm.
    pub size_mm: f64,
    /// p-value, corrected for the number of effects tested.
    pub p_value: f64,
    /// Errors before it was added.
    pub before: HeldOutErrors,
    /// Errors after.
    pub after: HeldOutErrors,
    /// Fall of the depth error, per cent.
    pub gain_percent: Option<GainInterval>,
}

/// A diagnosis.
pub struct Diagnosis {
    /// The outcome.
    pub verdict: Verdict,
    /// What was added, in order.
    pub steps: Vec<Step>,
    /// What every round found and decided.
    pub rounds: Vec<DiagnosisRound>,
    /// Frames that were left out.
    pub bad_frames: Vec<BadFrame>,
    /// Declarations that look wrong, in words.
    pub declarations: Vec<String>,
    /// What is left, in words.
    pub left_over: Vec<String>,
    /// What to capture next, in words.
    pub capture_next: Vec<String>,
    /// The declared model, fitted to all good frames.
    pub first: Calibrated,
    /// The last model, fitted to all good frames.
    pub last: Calibrated,
    /// The declared model on frames that it did not see.
    pub before: HeldOut,
    /// The last model on frames that it did not see.
    pub after: HeldOut,
    /// Every frame's own plane beside the last model.
    pub planes: Vec<FramePlane>,
    /// The examination of the last model.
    pub examination: Examination,
}

struct Loop<'a> {
    capture: Capture,
    verify: Option<&'a Capture>,
    options: CalibrateOptions,
    folds: usize,
}

impl Loop<'_> {
    fn fit(&self) -> Result<Calibrated, CalibrateError> {
        calibrate(&self.capture, &self.options)
    }

    /// Errors on frames that the model did not see.
    fn held_out(&self, fit: &Calibrated) -> Result<HeldOut, CalibrateError> {
        let evaluated = match self.verify {
            Some(verify) => evaluate(&fit.camera, verify),
            None => cross_validate(&fit.capture, self.folds.min(fit.capture.frames.len()), &self.options)?,
        };
        Ok(HeldOut { errors: errors(&evaluated), evaluated })
    }

    /// Adds an effect to the model, fits it, searches its constant again beside everything fitted, and fits once more.
    fn add(&mut self, found: &Evidence) -> Result<(String, HeldOut, Calibrated), CalibrateError> {
        self.options.effects.push(found.spec.clone());
        let mut fit = match self.fit() {
            // The data see fewer combinations than it has parameters: hold those that they see least of.
            Err(CalibrateError::Undetermined(_)) if found.reduced.is_some() => {
                self.set_last(found.reduced.clone().unwrap_or_default());
                self.fit()?
            }
            other => other?,
        };
        if let Some(finer) = refined_spec(&fit, &self.options.register, found) {
            self.set_last(finer);
            fit = self.fit()?;
        }
        let spec = self.options.effects.last().cloned().unwrap_or_default();
        Ok((spec, self.held_out(&fit)?, fit))
    }

    /// Adds the free map, in the form that brings most on held-out frames; it names nothing but corrects. `None` where it
    /// brings nothing.
    fn add_map(
        &mut self,
        found: &Evidence,
        present: &HeldOut,
        p_value: f64,
    ) -> Result<Option<(Step, Calibrated, HeldOut)>, CalibrateError> {
        let mut best: Option<(&str, HeldOut, Calibrated)> = None;
        let across = match found.along {
            Some(Along::Row) => Some(ROWS),
            Some(Along::Column) => Some(COLUMNS),
            _ => None,
        };
        for spec in MAPS.into_iter().chain(across) {
            self.options.effects.push(spec.to_owned());
            let tried = self.fit().and_then(|fit| Ok((self.held_out(&fit)?, fit)));
            self.options.effects.pop();
            let (after, fitted) = match tried {
                Ok(tried) => tried,
                Err(error) => {
                    info!("{spec} cannot be fitted: {error}");
                    continue;
                }
            };
            let rms = |h: &HeldOut| h.errors.depth_rms_mm.unwrap_or(f64::INFINITY);
            let lowest = best.as_ref().map_or(rms(present), |(_, b, _)| rms(b));
            if improves(present, &after, &fitted.noise.depth) && rms(&after) < lowest {
                best = Some((spec, after, fitted));
            }
        }
        let Some((spec, after, fitted)) = best else { return Ok(None) };
        self.options.effects.push(spec.to_owned());
        let step = Step {
            effects: vec![FREE_MAP.to_owned()],
            spec: spec.to_owned(),
            indistinguishable: Vec::new(),
            parameters: Vec::new(),
            size_mm: found.expected_size_mm,
            p_value,
            before: present.errors,
            after: after.errors,
            gain_percent: depth_gain_percent(&present.evaluated, &after.evaluated),
        };
        Ok(Some((step, fitted, after)))
    }

    fn set_last(&mut self, spec: String) {
        if let Some(last) = self.options.effects.last_mut() {
            *last = spec;
        }
    }

    /// Takes frames back that were left out before the effects were in the model which explain them. Returns whether there
    /// were any.
    fn readmit(&mut self, whole: &Capture, bad_frames: &mut Vec<BadFrame>) -> Result<bool, CalibrateError> {
        let out = |f: &Frame| bad_frames.iter().any(|b| b.name == f.name);
        if !whole.frames.iter().any(out) {
            return Ok(false);
        }
        let all = Capture { dropped: self.capture.dropped.clone(), ..whole.clone() };
        let planes = frame_planes(&calibrate(&all, &self.options)?);
        let still = outlying(&planes, 0.0);
        let back = |b: &BadFrame| {
            planes.iter().any(|p| p.name == b.name && p.p_value.is_finite()) && !still.iter().any(|p| p.name == b.name)
        };
        let returned: Vec<String> = bad_frames.iter().filter(|b| back(b)).map(|b| b.name.clone()).collect();
        bad_frames.retain(|b| !returned.contains(&b.name));
        self.capture = whole.subset(|_, f| bad_frames.iter().all(|b| b.name != f.name));
        Ok(!returned.is_empty())
    }

    /// Leaves bad frames out until there are none.
    fn drop_bad_frames(
        &mut self,
        fit: &mut Calibrated,
        bad_frames: &mut Vec<BadFrame>,
        least_mm: f64,
    ) -> Result<bool, CalibrateError> {
        let before = bad_frames.len();
        for _ in 0..FRAME_ROUNDS {
            let planes = frame_planes(fit);
            let bad = outlying(&planes, least_mm);
            if bad.is_empty() {
                break;
            }
            bad_frames.extend(explain(fit, &bad));
            self.capture = self.capture.subset(|_, f| bad_frames.iter().all(|b| b.name != f.name));
            *fit = self.fit()?;
        }
        Ok(bad_frames.len() > before)
    }
}

/// Diagnoses a capture: what does the declared model lack? Errors are those on `verify` where it is given, else on
/// left-out frames.
///
/// # Errors
///
/// [`DiagnoseError`] where the declared model cannot be fitted.
pub fn diagnose(
    capture: &Capture,
    verify: Option<&Capture>,
    options: &DiagnoseOptions,
) -> Result<Diagnosis, DiagnoseError> {
    if !capture.has_depth() {
        return Err(DiagnoseError::NoDepth { dataset: capture.name.clone() });
    }
    let (capture, mut bad_frames) = without_duplicates(capture);
    let whole = capture.clone();
    let mut run = Loop { capture, verify, options: options.calibrate.clone(), folds: options.folds };
    let mut fit = run.fit()?;
    run.drop_bad_frames(&mut fit, &mut bad_frames, GROSS_MM)?;
    let declarations = account::implausible_declarations(&fit);
    let (mut before, mut first) = (run.held_out(&fit)?, fit.clone());
    let mut present = before.clone();
    let (mut steps, mut rounds): (Vec<Step>, Vec<DiagnosisRound>) = (Vec::new(), Vec::new());
    let mut explained = 0.0_f64;
    let mut unexplained = None;
    // Effects that brought nothing beside the present model.
    let mut rejected: Vec<String> = Vec::new();
    let examination = loop {
        let examination = examine(&fit, &run.options.register)?;
        let least_share = WORTH_A_STEP * explained;
        let decision = decide(&examination, &frame_planes(&fit), least_share, &rejected);
        rounds.push(account::round(&examination, &decision));
        match &decision {
            Decision::Nothing => break examination,
            Decision::Unexplained { free, explained } => {
                let found = examination.evidence[*free].clone();
                if !rejected.is_empty() && decision::merit(&found) < WORTH_SAYING * examination.cost() {
                    account::stopped(&mut rounds, "too little to be a finding");
                    break examination;
                }
                let step = if found.along.is_some_and(Along::is_of_the_pixel) {
                    run.add_map(&found, &present, explained_by_map(&examination, &found))?
                } else {
                    None
                };
                unexplained = Some((found, *explained));
                if let Some((step, fitted, after)) = step {
                    steps.push(step);
                    (fit, present) = (fitted, after);
                }
                break examination;
            }
            Decision::Add { effect, beside, indistinguishable, .. } => {
                let found = &examination.evidence[*effect];
                let share = decision::merit(found) / examination.cost();
                if steps.len() >= MOST_ROUNDS || rejected.len() >= MOST_REJECTED {
                    account::stopped(&mut rounds, "no more rounds");
                    break examination;
                }
                let tried = run.add(found);
                let (spec, after, fitted) = match tried {
                    Ok((spec, after, fitted)) if improves(&present, &after, &fitted.noise.depth) => {
                        (spec, after, fitted)
                    }
                    Ok(_) => {
                        run.options.effects.pop();
                        account::stopped(&mut rounds, "added, it brings nothing on held-out frames");
                        rejected.push(found.name.clone());
                        continue;
                    }
                    Err(error) => {
                        run.options.effects.pop();
                        account::stopped(&mut rounds, &format!("it cannot be fitted: {error}"));
                        rejected.push(found.name.clone());
                        continue;
                    }
                };
                info!("added {spec}");
                rejected.clear();
                explained = explained.max(share);
                let effects = std::iter::once(found.name.clone()).chain(beside.iter().cloned()).collect();
                steps.push(Step {
                    effects,
                    spec,
                    indistinguishable: indistinguishable.clone(),
                    size_mm: examination.sights.size_mm(account::fitted_block(&fitted, &found.name)),
                    parameters: account::fitted_parameters(&fitted, &found.name),
                    p_value: (found.p_value * examination.tests as f64).min(1.0),
                    gain_percent: depth_gain_percent(&present.evaluated, &after.evaluated),
                    before: present.errors,
                    after: after.errors,
                });
                (fit, present) = (fitted, after);
                if run.drop_bad_frames(&mut fit, &mut bad_frames, 0.0)? {
                    // Numbers before and after are about the same frames.
                    let effects = std::mem::take(&mut run.options.effects);
                    run.options.effects = options.calibrate.effects.clone();
                    first = run.fit()?;
                    before = run.held_out(&first)?;
                    run.options.effects = effects;
                    present = run.held_out(&fit)?;
                }
            }
        }
    };
    if !steps.is_empty() && run.readmit(&whole, &mut bad_frames)? {
        fit = run.fit()?;
        present = run.held_out(&fit)?;
        let effects = std::mem::replace(&mut run.options.effects, options.calibrate.effects.clone());
        first = run.fit()?;
        before = run.held_out(&first)?;
        run.options.effects = effects;
    }
    let planes = frame_planes(&fit);
    let mut left_over = account::left_over(&unexplained);
    let own = share_with_own_plane(&planes);
    if own > MANY_OWN_PLANES {
        left_over.push(account::own_planes(&planes, own));
    }
    let verdict = match (left_over.is_empty(), steps.is_empty()) {
        (false, _) => Verdict::Unexplained,
        (true, false) => Verdict::Effect,
        (true, true) => Verdict::Adequate,
    };
    let mut capture_next = captures::capture_next(&fit, &run.options.register, &steps);
    capture_next.extend(captures::invisible(&run.options.register, &fit));
    Ok(Diagnosis {
        verdict,
        steps,
        rounds,
        bad_frames,
        declarations,
        left_over,
        capture_next,
        first,
        last: fit,
        before,
        after: present,
        planes,
        examination,
    })
}

/// p-value of a free function, corrected for their number.
fn explained_by_map(examination: &Examination, found: &Evidence) -> f64 {
    (found.p_value * examination.probes().count() as f64).min(1.0)
}

/// Whether a model is better than another on held-out frames: in depth, weighted by the noise, and in the image taken
/// together. What one gains the other must not lose.
fn improves(before: &HeldOut, after: &HeldOut, noise: &DepthNoise) -> bool {
    let gain = |b: f64, a: f64| if b > 0.0 { 100.0 * (1.0 - a / b) } else { 0.0 };
    let weighted = |h: &HeldOut| weighted_depth_rms(&h.evaluated, noise);
    let depth = weighted(before).zip(weighted(after)).map_or(0.0, |(b, a)| gain(b, a));
    let plain = before.errors.depth_rms_mm.zip(after.errors.depth_rms_mm).map_or(0.0, |(b, a)| gain(b, a));
    let image = gain(before.errors.reprojection_px, after.errors.reprojection_px);
    depth + image > LEAST_GAIN_PERCENT && plain > -MOST_LOSS_PERCENT
}
