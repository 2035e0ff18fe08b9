//! Closing the loop: fit, look at what is left, find which effect the model lacks, add it, fit again, and report the error
//! before and after on frames that the fit did not see; again until nothing is left that the data can show.
//!
//! | step | where |
//! |---|---|
//! | frames that do not belong | [`frames`] |
//! | which effects may be missing | [`candidates`] |
//! | free functions that compete with them | [`probe`] |
//! | what the residuals say about each | [`evidence`] |
//! | which explain together | `together` |
//! | which one to add, if any | [`decision`] |
//! | fits with effects added and taken out again | `trial` |
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
mod together;
mod trial;

use depthcal_io::{DiagnosisParameter, DiagnosisRound, GainInterval, HeldOutErrors, Interval, Verdict};
use depthcal_solver::score::ScoreError;
use thiserror::Error;

use crate::calibrate::{CalibrateError, CalibrateOptions, Calibrated};
use crate::judge::evaluate::Evaluated;
use crate::observe::Capture;
use decision::{Decision, decide};
use evidence::{Examination, examine};
use frames::{BadFrame, FramePlane, frame_planes, share_with_own_plane, without_duplicates};
use probe::Along;
use trial::{Added, Fitted, Trial};

/// Name of the free map: never a finding, but a correction.
pub const FREE_MAP: &str = "free_map";
/// Effects that bring nothing beside a model before the search ends.
const MOST_REJECTED: usize = 3;
/// What is left after effects were rejected is said when it is at least this share of the residuals' squares.
const WORTH_SAYING: f64 = 0.01;
/// Rounds in which an effect may be added.
const MOST_ROUNDS: usize = 9;
/// An added effect has to bring at least this share of what the effects before it brought.
const WORTH_A_STEP: f64 = 0.06;
/// Before any effect is in the model only frames that are off by this much are left out, mm: a missing effect may look like
/// a smaller one.
const GROSS_MM: f64 = 5.0;
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
    /// Depth error after, with its interval.
    pub depth_rms_after_mm: Option<Interval>,
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
    let mut trial = Trial::new(capture, verify, options.calibrate.clone(), options.folds);
    let mut fit = trial.fit_declared(&mut bad_frames)?;
    trial.drop_bad_frames(&mut fit, &mut bad_frames, GROSS_MM)?;
    let declarations = account::implausible_declarations(&fit);
    let mut first = Fitted { held_out: trial.held_out(&fit, &trial.declared)?, fit };
    let mut present = first.clone();
    let mut rounds: Vec<DiagnosisRound> = Vec::new();
    let mut explained = 0.0_f64;
    let mut unexplained = None;
    // Effects that brought nothing beside the present model.
    let mut rejected: Vec<String> = Vec::new();
    let examination = loop {
        trial.round += 1;
        trial.doing("examining what is left", &trial.present());
        let examination = examine(&present.fit, &options.calibrate.register)?;
        let least_share = WORTH_A_STEP * explained;
        let decision = decide(&examination, &frame_planes(&present.fit), least_share, &rejected);
        rounds.push(account::round(&examination, &decision));
        match &decision {
            Decision::Nothing => break examination,
            Decision::Unexplained { free, explained } => {
                let found = &examination.evidence[*free];
                if !rejected.is_empty() && decision::merit(found) < WORTH_SAYING * examination.cost() {
                    account::stopped(&mut rounds, "too little to be a finding");
                    break examination;
                }
                unexplained = Some((found.clone(), *explained));
                if found.along.is_some_and(Along::is_of_the_pixel) {
                    // Corrected for the number of free functions.
                    let p_value = (found.p_value * examination.probes().count() as f64).min(1.0);
                    trial.add_free_map(found, &mut present, p_value);
                }
                break examination;
            }
            Decision::Add { effect, beside, indistinguishable, .. } => {
                let found = &examination.evidence[*effect];
                if rounds.len() >= MOST_ROUNDS || rejected.len() >= MOST_REJECTED {
                    account::stopped(&mut rounds, "no more rounds");
                    break examination;
                }
                let candidates = candidates_to_add(&examination, *effect, beside, indistinguishable, &present.held_out);
                match trial.add(candidates, &present) {
                    Ok(Some(fitted)) => present = fitted,
                    Ok(None) => {
                        account::stopped(&mut rounds, "added, it brings nothing on held-out frames");
                        rejected.push(found.name.clone());
                        continue;
                    }
                    Err(error) => {
                        account::stopped(&mut rounds, &format!("it cannot be fitted: {error}"));
                        rejected.push(found.name.clone());
                        continue;
                    }
                }
                explained = explained.max(decision::merit(found) / examination.cost());
                rejected.clear();
                let needless = trial.take_out_needless(&mut present, examination.tests)?;
                if !needless.is_empty() {
                    account::stopped(&mut rounds, &format!("beside it nothing is left for {}", needless.join(", ")));
                }
                if trial.drop_bad_frames(&mut present.fit, &mut bad_frames, 0.0)? {
                    // Numbers before and after are about the same frames.
                    first = trial.fitted(&trial.declared)?;
                    present.held_out = trial.held_out(&present.fit, &trial.present())?;
                    trial.errors_along(0, &present.held_out)?;
                }
            }
        }
    };
    if !trial.added.is_empty() && trial.readmit(&whole, &mut bad_frames)? {
        present = trial.fitted(&trial.present())?;
        first = trial.fitted(&trial.declared)?;
        trial.errors_along(0, &present.held_out)?;
    }
    let steps = trial.steps(&first.held_out, &present.fit);
    let (fit, present) = (present.fit, present.held_out);
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
    let register = &options.calibrate.register;
    let mut capture_next = captures::capture_next(&fit, register, &steps);
    capture_next.extend(captures::invisible(register, &fit));
    Ok(Diagnosis {
        verdict,
        steps,
        rounds,
        bad_frames,
        declarations,
        left_over,
        capture_next,
        first: first.fit,
        last: fit,
        before: first.held_out,
        after: present,
        planes,
        examination,
    })
}

/// The effect that was found, and those that explain together with it.
fn candidates_to_add(
    examination: &Examination,
    effect: usize,
    beside: &[usize],
    indistinguishable: &[String],
    present: &HeldOut,
) -> Vec<Added> {
    let members: Vec<usize> = std::iter::once(effect).chain(beside.iter().copied()).collect();
    (0..members.len())
        .map(|i| {
            let evidence = examination.evidence[members[i]].clone();
            let p_value = match i {
                0 => evidence.p_value,
                _ => together::beside(examination, members[i], &members[..i]).1,
            };
            Added {
                effects: account::names(examination, &members[i..]),
                indistinguishable: if i == 0 { indistinguishable.to_vec() } else { Vec::new() },
                p_value: (p_value * examination.tests as f64).min(1.0),
                after: present.clone(),
                evidence,
            }
        })
        .collect()
}
