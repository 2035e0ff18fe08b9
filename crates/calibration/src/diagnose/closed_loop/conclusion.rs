//! The end of the loop: what its state says.

use depthcal_io::Verdict;

use super::bench::{Bench, Fitted};
use super::fitter::Fitter;
use super::state::State;
use crate::calibrate::with_frame_scatter;
use crate::diagnose::diagnosis::CameraDiagnosis;
use crate::diagnose::discovery::{Discovery, components, searched};
use crate::diagnose::error::DiagnoseError;
use crate::diagnose::examination::Examination;
use crate::diagnose::experiment_design::{distinguishing_frames, frames_against_rivals, missing_covariates};
use crate::diagnose::frame_planes::{FramePlane, frame_planes, share_with_own_plane};
use crate::diagnose::left_over::LeftOver;
use crate::diagnose::pure_error::{PureError, pure_error};
use crate::diagnose::step::{Step, steps};
use crate::diagnose::thresholds::Thresholds;

/// The diagnosis that the last state comes to; `examination` is that of its present model.
///
/// # Errors
///
/// [`DiagnoseError::NotFitted`] where the last fit lacks an added effect.
pub(super) fn conclude(
    fitter: &Fitter<'_>,
    state: State,
    examination: Examination,
) -> Result<CameraDiagnosis, DiagnoseError> {
    let State { frames, model, present, first, memory, findings, rounds } = state;
    let bench = fitter.on(&frames.used, rounds.len());
    let (declared, thresholds) = (bench.declared(), bench.thresholds());
    let options = model.options(declared);
    bench.report("looking for what to capture next", &options);
    // The search ignores the scatter between frames; the reported covariance includes it.
    let Fitted { fit, held_out } = present;
    let fit = with_frame_scatter(fit);
    let steps = steps(&model.added, &first.held_out, &fit)?;
    let planes = frame_planes(&fit);
    bench.report("comparing frames", &options);
    let pure_error = pure_error(&fit, thresholds);
    let left_over = all_left_over(findings.left_over, &planes, pure_error.as_ref(), thresholds);
    let mut formulas = formulas_in(&steps, &model.formulas);
    for formula in &mut formulas {
        formula.components = components(&fit, &formula.effect, formula.place.of);
    }
    let mut capture_next = distinguishing_frames(&fit, &declared.register, &steps, thresholds);
    for formula in &formulas {
        let step = steps.iter().filter(|step| step.spec.name == formula.effect.name());
        let rivals = |step| frames_against_rivals(&fit, options.register.clone(), step, formula, thresholds);
        capture_next.extend(step.take(1).flat_map(rivals));
    }
    capture_next.extend(missing_covariates(&fit, &declared.register, thresholds));
    Ok(CameraDiagnosis {
        verdict: verdict(&left_over, &formulas, &steps),
        possible: findings.possible.into_iter().filter(|p| fit.camera.block(&p.spec.name).is_none()).collect(),
        steps,
        pure_error,
        rounds,
        bad_frames: frames.bad,
        declarations: findings.declarations,
        left_over,
        formulas,
        searched: memory.tried.functions.then(|| searched(&fit)).flatten(),
        formula_refused: findings.formula_refused,
        capture_next,
        first: first.fit,
        last: fit,
        before: first.held_out,
        after: held_out,
        planes,
        examination,
    })
}

/// Structure that the last model leaves: what the rounds left over, planes of many frames, and what frames share.
fn all_left_over(
    mut left_over: Vec<LeftOver>,
    planes: &[FramePlane],
    pure_error: Option<&PureError>,
    thresholds: &Thresholds,
) -> Vec<LeftOver> {
    let share = share_with_own_plane(planes, thresholds);
    if share > thresholds.many_own_planes {
        left_over.push(LeftOver::frame_planes(planes, share));
    }
    let shared = pure_error.and_then(|pure_error| LeftOver::shared(pure_error, &left_over, thresholds));
    left_over.extend(shared);
    left_over
}

/// The formulas that are still among the effects.
fn formulas_in(steps: &[Step], formulas: &[Discovery]) -> Vec<Discovery> {
    let is_step = |f: &&Discovery| steps.iter().any(|step| step.spec.name == f.effect.name());
    formulas.iter().filter(is_step).cloned().collect()
}

/// Something is unexplained where anything is left, and where a formula that no other frames confirmed explains it.
fn verdict(left_over: &[LeftOver], formulas: &[Discovery], steps: &[Step]) -> Verdict {
    let is_candidate = formulas.iter().any(|formula| !formula.confirmed);
    match (left_over.is_empty() && !is_candidate, steps.is_empty()) {
        (false, _) => Verdict::Unexplained,
        (true, false) => Verdict::Effect,
        (true, true) => Verdict::Adequate,
    }
}

#[cfg(test)]
mod tests {
    use super::super::linear_bench::{FORMULA, LinearBench, formula, regressor};
    use super::*;
    use crate::diagnose::free_functions::Along;
    use crate::diagnose::linear_examination::{planes, quiet_planes};

    #[test]
    fn the_verdict_is_unexplained_where_anything_is_left_or_nothing_confirms_a_formula() {
        let bench = LinearBench::new(&[("range_offset", 0.5, regressor(1))]);
        let state = bench.state(&["range_offset"]);
        let steps = steps(&state.model.added, &state.first.held_out, &state.present.fit).unwrap();
        let left = LeftOver::FreeFunction { along: Along::Depth, size_mm: 1.0, explained: 0.0 };
        assert_eq!(verdict(&[], &[], &[]), Verdict::Adequate);
        assert_eq!(verdict(&[], &[], &steps), Verdict::Effect);
        assert_eq!(verdict(&[left], &[], &steps), Verdict::Unexplained);
        assert_eq!(verdict(&[], &[formula(FORMULA)], &steps), Verdict::Effect);
        assert_eq!(verdict(&[], &[Discovery { confirmed: false, ..formula(FORMULA) }], &steps), Verdict::Unexplained);
    }

    #[test]
    fn formulas_that_were_replaced_are_not_reported() {
        let bench = LinearBench::new(&[("range_offset", 0.5, regressor(1)), (FORMULA, 0.5, regressor(2))]);
        let state = bench.state(&["range_offset"]);
        let mut steps = steps(&state.model.added, &state.first.held_out, &state.present.fit).unwrap();
        assert!(formulas_in(&steps, &[formula(FORMULA)]).is_empty());
        steps[0].spec = formula(FORMULA).effect.spec();
        assert_eq!(formulas_in(&steps, &[formula(FORMULA)]).len(), 1);
    }

    #[test]
    fn planes_of_many_frames_are_left_over() {
        let thresholds = Thresholds::default();
        let function = LeftOver::FreeFunction { along: Along::Depth, size_mm: 1.0, explained: 0.0 };
        let left = all_left_over(vec![function.clone()], &quiet_planes(), None, &thresholds);
        assert_eq!(left, std::slice::from_ref(&function));
        let mut deviating = planes(100.0);
        deviating.iter_mut().for_each(|plane| plane.p_value = 1e-9);
        let left = all_left_over(vec![function], &deviating, None, &thresholds);
        assert!(matches!(left[..], [_, LeftOver::FramePlanes { share, rms_mm }] if share == 1.0 && rms_mm == 1.0));
    }
}
