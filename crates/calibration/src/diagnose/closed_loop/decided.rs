//! The decision of a round, without effects that are refuted.

use depthcal_model::hook::HookKind;
use depthcal_solver::score::ScoreError;

use super::state::Memory;
use crate::calibrate::{CalibratedCamera, CameraOptions};
use crate::diagnose::decision::{Decision, RuledOut, decide};
use crate::diagnose::evidence::Evidence;
use crate::diagnose::examination::Examination;
use crate::diagnose::frame_planes::{FramePlane, frame_planes};
use crate::diagnose::lens_in_image::shows_in_images;
use crate::diagnose::options::CameraDiagnoseOptions;
use crate::diagnose::own_function::share_of_own_function;
use crate::diagnose::round::{Refutation, Refuted};
use crate::diagnose::thresholds::Thresholds;

/// A decision, and the effects that it disregards.
pub(super) struct Decided {
    pub decision: Decision,
    pub refuted: Vec<Refuted>,
}

/// Decides on an examination of a fit; effects of one covariate are refuted where a free function of it explains much more, and
/// those of the lens where something remains unexplained and images alone do not show them.
///
/// # Errors
///
/// [`ScoreError`] where a refutation cannot be evaluated.
pub(super) fn decided(
    fit: &CalibratedCamera,
    examination: &Examination,
    memory: &Memory,
    options: &CameraDiagnoseOptions,
) -> Result<Decided, ScoreError> {
    let CameraDiagnoseOptions { calibrate: CameraOptions { register, .. }, thresholds, .. } = options;
    let refutation = |effect: &Evidence, others: &[&Evidence], leaves_unexplained: bool| {
        if leaves_unexplained && !shows_in_images(fit, register, effect, others, thresholds)? {
            return Ok(Some(Refutation::NotInImages));
        }
        let share = share_of_own_function(fit, register, &examination.states, effect, others, thresholds)?;
        let small = share.filter(|(_, share)| *share < thresholds.least_explained_of_own);
        Ok(small.map(|(along, explained)| Refutation::OwnFunction { along, explained }))
    };
    let mut decided = without_refuted(examination, &frame_planes(fit), memory, thresholds, refutation)?;
    if let Decision::Add { effect, indistinguishable, .. } = &mut decided.decision
        && !shows_in_images(fit, register, &examination.evidence[*effect], &[], thresholds)?
    {
        indistinguishable.extend(rivals_of_depth(examination, *effect));
    }
    Ok(decided)
}

/// Share of an effect's gain from which on an effect of depth may be what an effect of the lens is taken for.
const RIVALS: f64 = 0.9;

/// Names of the effects of depth that explain nearly as much as an effect of the lens that images do not show: poses take up what
/// it does to images, such as a focal length that changes with distance, so that depth alone speaks for it.
fn rivals_of_depth(examination: &Examination, effect: usize) -> Vec<String> {
    let least = RIVALS * examination.evidence[effect].gain();
    let rivals = examination.effects().filter(|e| e.block.hook() == HookKind::Depth && e.gain() >= least);
    rivals.map(|e| e.name.clone()).collect()
}

/// Decides again until the decision proposes no effect that `refutation` refutes. It is given an effect, the others that are
/// proposed together with it, and whether something remains unexplained.
fn without_refuted(
    examination: &Examination,
    planes: &[FramePlane],
    memory: &Memory,
    thresholds: &Thresholds,
    refutation: impl Fn(&Evidence, &[&Evidence], bool) -> Result<Option<Refutation>, ScoreError>,
) -> Result<Decided, ScoreError> {
    let all = &examination.evidence;
    let least_share = thresholds.least_relative_gain * memory.largest_share;
    let hidden = (0..all.len()).filter(|i| memory.hidden.contains(&all[*i].name));
    let mut refuted: Vec<Refuted> = hidden.map(|effect| Refuted { effect, because: Refutation::NotInImages }).collect();
    loop {
        let places: Vec<usize> = refuted.iter().map(|r| r.effect).collect();
        let ruled_out = RuledOut { rejected: &memory.tried.rejected, refuted: &places };
        let decision = decide(examination, planes, least_share, ruled_out, thresholds);
        let Decision::Add { effect, jointly_with, leaves_unexplained, .. } = &decision else {
            return Ok(Decided { decision, refuted });
        };
        let members: Vec<usize> = std::iter::once(*effect).chain(jointly_with.iter().copied()).collect();
        let before = refuted.len();
        for member in &members {
            let others: Vec<&Evidence> = members.iter().filter(|m| *m != member).map(|m| &all[*m]).collect();
            let because = refutation(&all[*member], &others, *leaves_unexplained)?;
            refuted.extend(because.map(|because| Refuted { effect: *member, because }));
        }
        if refuted.len() == before {
            return Ok(Decided { decision, refuted });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::linear_bench::{LinearBench, regressor};
    use super::super::state::{Accepted, Event, Rejection, State};
    use super::*;
    use crate::diagnose::linear_examination::{Planted, examined, quiet_planes};

    /// Name of the effect that is to be added, and names of the refuted ones, where the effects `refuses` are refuted.
    fn outcome(examination: &Examination, memory: &Memory, refuses: &[&str]) -> (Option<String>, Vec<String>) {
        let refutation = |effect: &Evidence, _: &[&Evidence], _: bool| {
            Ok(refuses.contains(&effect.name.as_str()).then_some(Refutation::NotInImages))
        };
        let thresholds = Thresholds::default();
        let decided = without_refuted(examination, &quiet_planes(), memory, &thresholds, refutation).unwrap();
        let name = |i: usize| examination.evidence[i].name.clone();
        let added = match decided.decision {
            Decision::Add { effect, .. } => Some(name(effect)),
            Decision::Nothing | Decision::Unexplained { .. } => None,
        };
        (added, decided.refuted.iter().map(|refuted| name(refuted.effect)).collect())
    }

    #[test]
    fn a_refuted_effect_is_left_out_of_the_decision() {
        let e = examined(Planted { a: 0.3, b: 0.4, ..Planted::default() }, 4);
        let memory = Memory::default();
        let some = |name: &str| Some(name.to_owned());
        assert_eq!(outcome(&e, &memory, &[]), (some("b"), vec![]));
        assert_eq!(outcome(&e, &memory, &["b"]), (some("a"), vec!["b".to_owned()]));
        assert_eq!(outcome(&e, &memory, &["a", "b"]).0, None);
        // A refutation of an effect that is not proposed is not asked for.
        let alone = examined(Planted { a: 0.3, ..Planted::default() }, 5);
        assert_eq!(outcome(&alone, &memory, &["b"]), (some("a"), vec![]));
    }

    #[test]
    fn hidden_effects_are_refuted_from_the_start() {
        let e = examined(Planted { a: 0.3, b: 0.4, ..Planted::default() }, 4);
        let memory = Memory { hidden: vec!["b".to_owned()], ..Memory::default() };
        assert_eq!(outcome(&e, &memory, &[]), (Some("a".to_owned()), vec!["b".to_owned()]));
    }

    #[test]
    fn a_rejected_effect_is_tried_again_under_another_model_only() {
        let e = examined(Planted { a: 0.3, ..Planted::default() }, 5);
        let bench = LinearBench::new(&[("range_offset", 0.5, regressor(1))]);
        let mut state = bench.state(&[]);
        assert_eq!(outcome(&e, &state.memory, &[]).0.as_deref(), Some("a"));
        state.apply(Event::Rejected { effects: vec!["a".to_owned()], because: Rejection::NoHeldOutGain(None) });
        assert_eq!(outcome(&e, &state.memory, &[]).0, None);
        let State { model, present, .. } = bench.state(&["range_offset"]);
        let largest_share = state.memory.largest_share;
        state.apply(Event::Accepted(Box::new(Accepted { model, present, largest_share, outcome: None })));
        assert_eq!(outcome(&e, &state.memory, &[]).0.as_deref(), Some("a"));
    }

    #[test]
    fn effects_far_smaller_than_one_before_are_none() {
        let e = examined(Planted { a: 0.3, ..Planted::default() }, 6);
        // The effect is some 5 % of the cost.
        let memory = |largest_share: f64| Memory { largest_share, ..Memory::default() };
        assert_eq!(outcome(&e, &memory(0.3), &[]).0.as_deref(), Some("a"));
        assert_eq!(outcome(&e, &memory(2.0), &[]).0, None);
    }
}
