//! The state before the first round: the declared model, fitted to the frames that belong together.

use super::augmented_model::AugmentedModel;
use super::bench::{Bench, Fitted};
use super::fitter::Fitter;
use super::frames::{Frames, explained_again, fit_declared, without_outlying};
use super::state::State;
use crate::calibrate::{CalibrateError, CameraOptions, check_frames_agree, implausible_scale};
use crate::diagnose::bad_frames::BadFrame;
use crate::diagnose::options::CameraDiagnoseOptions;
use crate::observe::CameraFrames;

/// Rounds in which the smoothness of the free map is chosen: with more, smoothness and noise may settle where the map is flat and
/// all that it should describe counts as noise.
const FREE_MAP_ROUNDS: usize = 4;

/// Options with which the loop fits the models of a capture.
pub(super) fn options_of_fits(capture: &CameraFrames, options: &CameraDiagnoseOptions) -> CameraDiagnoseOptions {
    let calibrate = CameraOptions {
        frame_planes: false,
        smoothness_rounds: FREE_MAP_ROUNDS,
        samples_for_search: true,
        ..options.calibrate.for_board(&capture.target)
    };
    CameraDiagnoseOptions { calibrate, ..options.clone() }
}

/// Fits the declared model without frames that do not belong to the others; `duplicates` are excluded already.
///
/// # Errors
///
/// [`CalibrateError`] where the declared model cannot be fitted.
pub(super) fn start(fitter: &Fitter<'_>, duplicates: Vec<BadFrame>) -> Result<State, CalibrateError> {
    let all = Frames { used: fitter.whole.clone(), bad: duplicates };
    let (mut frames, mut fit) = fit_declared(fitter, all)?;
    let model = AugmentedModel::default();
    let gross_mm = fitter.on(&frames.used, 0).thresholds().gross_plane_mm;
    if let Some(without) = without_outlying(fitter, 0, &model, (&frames, &fit), gross_mm)? {
        (frames, fit) = without;
    }
    frames = explained_again(fitter, &fit, frames);
    let bench = fitter.on(&frames.used, 0);
    // Effects would be found in the contradiction of frames that are of two cameras.
    check_frames_agree(&frames.used, &fit, &bench.options().calibrate)?;
    let scale = implausible_scale(&fit.capture, bench.thresholds().plausible_scale_deviation);
    let first = Fitted { held_out: bench.held_out(&fit, bench.declared())?, fit };
    Ok(State::new(frames, first, scale.into_iter().collect()))
}
