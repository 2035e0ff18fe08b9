//! Cross-validation of calibrated cameras: errors on frames that their adjustment did not see.

use rayon::prelude::*;

use super::cross_validation::cross_validate_camera;
use super::evaluate::{Evaluated, NotFitted, evaluate};
use super::parts::{Parts, parts_of};
use crate::adjust::adjustment::Adjustment;
use crate::adjust::leave_out::DECREASE;
use crate::adjust::state::State;
use crate::calibrate::{CalibrateError, CalibrateOptions, Calibrated};
use crate::observe::{CameraCapture, Capture, PlacedCamera};

/// Errors of every frame of a capture under cameras and extrinsics that were adjusted without it: without each of `parts` parts
/// of the frames, with the noise of all. A frame is left out of all cameras. Where the others do not determine the cameras, the
/// part's frames are dropped with the reason.
///
/// # Errors
///
/// [`CalibrateError`] if no fold could be fitted.
pub fn cross_validate(
    fit: &Calibrated,
    capture: &Capture,
    parts: usize,
    how: Parts,
    options: &CalibrateOptions,
) -> Result<Evaluated, CalibrateError> {
    if let ([only], Some(camera)) = (&capture.cameras[..], fit.only_camera()) {
        let mut camera_options = options.of_only(only);
        if let Some(comparison) = &camera.lens_comparison {
            // Parts are fitted with the lens of the whole.
            camera_options.lens.clone_from(&comparison.chosen);
        }
        let evaluated = cross_validate_camera(camera, parts, how, &camera_options)?;
        return Ok(Evaluated::of_camera(&only.name, evaluated));
    }
    let job = options.each.progress.steps("cross-validating", parts);
    let state = &fit.state;
    let part_of = parts_of(&markers_of_frames(state), parts, how);
    let of_part = |part: usize| {
        let fitted = state.subset(|frame| part_of[frame] != part);
        let is_held = |name: &str| state.frames.iter().zip(&part_of).any(|(f, of)| *of == part && f.name == name);
        let held = capture.subset(is_held);
        let evaluated = adjusted(fitted).map(|rig| evaluate(&rig, &held)).map_err(|error| {
            let names = |camera: &CameraCapture| camera.capture.frames.iter().map(|f| f.name.clone()).collect();
            let frames = held.cameras.iter().map(|camera| (camera.name.clone(), names(camera))).collect();
            Box::new(NotFitted { error, frames })
        });
        job.advance();
        evaluated
    };
    let evaluated = (0..parts).into_par_iter().map(of_part).collect();
    Evaluated::empty(capture).joined(evaluated, "rig")
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
    let adjusted = Adjustment::of_state(&state, true)?.refine_within(DECREASE)?;
    if !adjusted.has_converged() {
        return Err(CalibrateError::NotConverged { reason: adjusted.report.termination.to_string() });
    }
    adjusted.give(&mut state);
    Ok(state.placed())
}
