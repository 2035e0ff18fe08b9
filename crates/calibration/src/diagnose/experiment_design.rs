//! Experiment design: captures that would answer what these captures leave open. Frames that would distinguish effects, and
//! covariates that were not recorded.

use std::collections::BTreeSet;

use depthcal_model::{Context, Covariate, PieceSpec, Register, Role};
use nalgebra::DVector;
use tracing::info;

use super::candidate_blocks::{CandidateBlock, linearize};
use super::discovery::{Discovery, RUNNER_UP};
use super::observed_states::ObservedStates;
use super::step::Step;
use super::thresholds::Thresholds;
use crate::calibrate::CalibratedCamera;
use crate::observe::SampledFrame;
use crate::plan::{BoardTilt, ImagePlace, ProposedFrame, pose_showing, predicted_frame};

/// Distance of the farthest proposed frame over the largest depth that was captured.
const FARTHER: f64 = 1.3;
/// Rise of the temperature over the highest one of the captures that a proposed frame may have, °C.
const WARMER_C: f64 = 10.0;

/// A capture that would answer an open question.
#[derive(Debug, Clone, PartialEq)]
pub enum CaptureProposal {
    /// A frame that would distinguish an effect from another one that these captures cannot distinguish from it.
    Distinguish {
        /// The effect that was added.
        effect: String,
        /// The other effect.
        rival: String,
        /// The best one of the frames that were tried.
        frame: ProposedFrame,
        /// Number of such frames with which the noncentrality is sufficient.
        frames: f64,
        /// Noncentrality of the effect given the other one (squared distance in standard deviations) with these captures.
        noncentrality: f64,
        /// Noncentrality with one frame more.
        noncentrality_with_frame: f64,
        /// Noncentrality that is sufficient: [`Thresholds::distinguishing_noncentrality`].
        sufficient_noncentrality: f64,
    },
    /// A covariate without which effects cannot show.
    Record {
        /// The covariate.
        covariate: Covariate,
        /// The effects.
        effects: Vec<String>,
    },
}

/// For every added effect and every effect that the captures cannot distinguish from it: the frame that would distinguish them
/// best.
pub fn distinguishing_frames(
    fit: &CalibratedCamera,
    register: &Register,
    steps: &[Step],
    thresholds: &Thresholds,
) -> Vec<CaptureProposal> {
    let mut proposals = Vec::new();
    for step in steps.iter().filter(|s| !s.indistinguishable.is_empty()) {
        for rival in &step.indistinguishable {
            proposals.extend(distinguish(fit, register, step, rival, thresholds));
        }
    }
    proposals
}

/// For a formula: the frame that would distinguish it best from each effect of the catalogue that it resembles, and from the best
/// formula of other covariates, which the proposal names by its text. `register` has the formula.
pub fn frames_against_rivals(
    fit: &CalibratedCamera,
    mut register: Register,
    step: &Step,
    formula: &Discovery,
    thresholds: &Thresholds,
) -> Vec<CaptureProposal> {
    let of_catalogue = formula.resembles.iter().map(|name| (name.clone(), name.clone()));
    let mut rivals: Vec<(String, String)> = of_catalogue.collect();
    if let Some(lost) = formula.runners_up.first() {
        match lost.effect.register(&mut register) {
            Ok(()) => rivals.push((RUNNER_UP.to_owned(), lost.effect.text())),
            Err(error) => info!("{error}"),
        }
    }
    let proposal = |(name, told): (String, String)| match distinguish(fit, &register, step, &name, thresholds)? {
        CaptureProposal::Distinguish { effect, frame, frames, noncentrality, noncentrality_with_frame, .. } => {
            Some(CaptureProposal::Distinguish {
                effect,
                rival: told,
                frame,
                frames,
                noncentrality,
                noncentrality_with_frame,
                sufficient_noncentrality: thresholds.distinguishing_noncentrality,
            })
        }
        other @ CaptureProposal::Record { .. } => Some(other),
    };
    rivals.into_iter().filter_map(proposal).collect()
}

fn distinguish(
    fit: &CalibratedCamera,
    register: &Register,
    step: &Step,
    rival: &str,
    thresholds: &Thresholds,
) -> Option<CaptureProposal> {
    let name = step.effects.first()?;
    let fitted = fit.camera.block(name)?;
    let without = CalibratedCamera { camera: fit.camera.filtered(|b| b.name() != name), ..fit.clone() };
    let candidates: Vec<CandidateBlock> = [step.spec.clone(), PieceSpec::new(rival)]
        .into_iter()
        .filter_map(|spec| CandidateBlock::effect(register, spec))
        .collect();
    let nominal = candidates.first()?.block.theta.clone();
    let effect = DVector::from_iterator(nominal.len(), fitted.theta.iter().zip(&nominal).map(|(a, b)| a - b));
    let present = linearize(&without, &candidates).ok()?;
    let now = present.noncentrality(0, &effect, &[1]);
    let (frames, predicted): (Vec<ProposedFrame>, Vec<SampledFrame>) = possible_frames(fit).into_iter().unzip();
    let further = CalibratedCamera { capture: fit.capture.with_frames(predicted), ..without };
    let further = linearize(&further, &candidates).ok()?;
    let (best, then) = (0..frames.len())
        .map(|i| (i, present.with_cluster(&further, i).noncentrality(0, &effect, &[1])))
        .max_by(|a, b| a.1.total_cmp(&b.1))?;
    let sufficient = thresholds.distinguishing_noncentrality;
    let number = ((sufficient - now) / (then - now).max(1e-9)).ceil().max(1.0);
    Some(CaptureProposal::Distinguish {
        effect: name.clone(),
        rival: rival.to_owned(),
        frame: frames[best],
        frames: number,
        noncentrality: now,
        noncentrality_with_frame: then,
        sufficient_noncentrality: sufficient,
    })
}

/// Frames over distances, places in the image, tilts and temperatures that show the whole board, with the observations that
/// the fitted camera predicts for them.
fn possible_frames(fit: &CalibratedCamera) -> Vec<(ProposedFrame, SampledFrame)> {
    let states = ObservedStates::of(fit);
    let Some(depth) = states.range(|s, _| 1.0 / s[2]) else { return Vec::new() };
    let temperature = states.range(|_, c| c.temperature_c);
    let amplitude = states.range(|_, c| c.amplitude).map_or(f64::NAN, |r| r.middle);
    let quantities = states.usual_quantities();
    let time_s = states.range(|_, c| c.time_s).map_or(0.0, |r| r.middle);
    let mut conditions = vec![(None, temperature.map_or(f64::NAN, |t| t.middle))];
    conditions.extend(temperature.map(|t| (Some(WARMER_C), t.high + WARMER_C)));
    let (w, h) = (fit.camera.width as f64, fit.camera.height as f64);
    let mut list = Vec::new();
    for distance_mm in [depth.low, depth.middle, depth.high, FARTHER * depth.high] {
        for place in ImagePlace::DIAGNOSED {
            let [u, v] = place.position();
            for tilt in BoardTilt::DIAGNOSED {
                for (warmer_c, temperature_c) in &conditions {
                    let temperature_c = *temperature_c;
                    let context = Context { amplitude, time_s, temperature_c, quantities, ..Context::default() };
                    let (camera, target) = (&fit.camera, &fit.capture.target);
                    let pose = pose_showing(camera, target, distance_mm, [u * w, v * h], tilt.angles_deg());
                    if let Some(frame) = pose.and_then(|p| predicted_frame(camera, target, &p, &context)) {
                        list.push((ProposedFrame { distance_mm, place, tilt, warmer_c: *warmer_c }, frame));
                    }
                }
            }
        }
    }
    list
}

/// Covariates that the captures lack and that effects of the register, which the camera does not have, need to show.
pub fn missing_covariates(
    fit: &CalibratedCamera,
    register: &Register,
    thresholds: &Thresholds,
) -> Vec<CaptureProposal> {
    let states = ObservedStates::of(fit);
    let least_span = |covariate: Covariate| match covariate {
        Covariate::Temperature => thresholds.informative_temperature_span_c,
        Covariate::Time => f64::MIN_POSITIVE,
        _ => 0.0,
    };
    let is_missing = |c: &Covariate| {
        c.is_recorded()
            && states.range(|state, context| c.value(state, context)).is_none_or(|r| r.span() < least_span(*c))
    };
    let lacking =
        register.names().filter(|name| fit.camera.block(name).is_none()).filter_map(|name| register.find(name));
    let lacking: Vec<_> = lacking.filter(|piece| piece.role() == Role::Effect).collect();
    let proposal = |covariate: &Covariate| {
        // An effect is named with the first covariate that it lacks.
        let effects = lacking.iter().filter(|p| p.needs().iter().find(|c| is_missing(c)) == Some(covariate));
        let effects: Vec<String> = effects.map(|piece| piece.name().to_owned()).collect();
        (!effects.is_empty()).then_some(CaptureProposal::Record { covariate: *covariate, effects })
    };
    let of_users = lacking.iter().flat_map(|p| p.needs()).filter(|c| matches!(c, Covariate::Quantity(_)));
    let of_users: BTreeSet<Covariate> = of_users.copied().collect();
    Covariate::ALL.iter().chain(&of_users).filter(|c| is_missing(c)).filter_map(proposal).collect()
}
