//! Cross-validation of a rig: errors on frames that its adjustment did not see.

use rayon::prelude::*;

use super::parts::{Parts, parts_of};
use super::rig::{EvaluatedRig, NotFitted, evaluate_rig};
use crate::adjust::adjustment::Adjustment;
use crate::adjust::leave_out::DECREASE;
use crate::adjust::state::State;
use crate::calibrate::CalibrateError;
use crate::calibrate::rig::RigCalibrated;
use crate::observe::{CameraCapture, PlacedCamera, RigCapture};
use crate::progress::ProgressHandle;

/// Errors of every frame of a rig under cameras and extrinsics that were adjusted without it: without each of `parts` parts of
/// the frames, with the noise of all. A frame is left out of all cameras. Where the others do not determine the rig, the part's
/// frames are dropped with the reason.
///
/// # Errors
///
/// [`CalibrateError`] if no fold could be fitted.
pub fn cross_validate_rig(
    fit: &RigCalibrated,
    capture: &RigCapture,
    parts: usize,
    how: Parts,
    progress: &ProgressHandle,
) -> Result<EvaluatedRig, CalibrateError> {
    let job = progress.steps("cross-validating", parts);
    let state = &fit.state;
    let part_of = parts_of(&markers_of_frames(state), parts, how);
    let of_part = |part: usize| {
        let fitted = state.subset(|frame| part_of[frame] != part);
        let is_held = |name: &str| state.frames.iter().zip(&part_of).any(|(f, of)| *of == part && f.name == name);
        let held = capture.subset(is_held);
        let evaluated = adjusted(fitted).map(|rig| evaluate_rig(&rig, &held)).map_err(|error| {
            let names = |camera: &CameraCapture| camera.capture.frames.iter().map(|f| f.name.clone()).collect();
            let frames = held.cameras.iter().map(|camera| (camera.name.clone(), names(camera))).collect();
            Box::new(NotFitted { error, frames })
        });
        job.advance();
        evaluated
    };
    let evaluated = (0..parts).into_par_iter().map(of_part).collect();
    EvaluatedRig::empty(capture).joined(evaluated, "rig")
}

/// Numbers of the markers of every frame that all cameras see.
fn markers_of_frames(state: &State) -> Vec<usize> {
    let mut markers = vec![0; state.frames.len()];
    for camera in &state.cameras {
        for (frame, number) in camera.capture.frames.iter().zip(&camera.frames) {
            markers[*number] += frame.markers.len();
        }
    }
    markers
}

/// The cameras that some frames determine, from the values of the adjustment of all.
fn adjusted(mut state: State) -> Result<Vec<PlacedCamera>, CalibrateError> {
    state.take_motions();
    let adjusted = Adjustment::of_state(&state, true)?.solve_within(DECREASE)?;
    if !adjusted.has_converged() {
        return Err(CalibrateError::NotConverged { reason: adjusted.report.termination.to_string() });
    }
    adjusted.give(&mut state);
    Ok(state.placed())
}
