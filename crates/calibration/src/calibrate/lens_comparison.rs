//! `--lens auto`: lens models compared on left-out frames.
//!
//! Every model is fitted to all frames, and to each part of a cross-validation from there. The error of a left-out frame is what
//! its markers leave with a pose of their own. The simplest model within one standard error of the best wins (Breiman, Friedman,
//! Olshen, Stone 1984, section 3.4.3); of those, one that is one-to-one over the image.

use depthcal_io::{ComparedLens, LensComparison};
use depthcal_model::Camera;
use rayon::prelude::*;
use tracing::info;

use super::calibrated_camera::CalibratedCamera;
use super::camera_options::CameraOptions;
use super::error::CalibrateError;
use super::frame_checks::markers_of;
use super::lens_choice::one_to_one;
use crate::adjust::smoothness_selection::errors_worse;
use crate::observe::{CameraFrames, PosedFrame};
use crate::start::{LensModel, estimate_pose, lens_models};

/// Value of `--lens` that asks for a comparison.
pub const AUTO: &str = "auto";
/// Parts of the cross-validation.
const FOLDS: usize = 5;
/// Standard errors by which a lens may be worse than the best and still be chosen for being simpler.
const EQUAL_STANDARD_ERRORS: f64 = 1.0;

/// Fits one lens model to a capture.
type Fit<'a> =
    dyn Fn(&CameraFrames, &CameraOptions) -> Result<CalibratedCamera<PosedFrame>, CalibrateError> + Sync + 'a;

/// The calibration with the lens that is chosen on left-out frames, and the comparison in it. `fit` calibrates from images with
/// the lens of its options.
///
/// # Errors
///
/// That of the last lens model, where none can be fitted.
pub(super) fn fit_best_lens(
    capture: &CameraFrames,
    options: &CameraOptions,
    fit: &Fit<'_>,
) -> Result<CalibratedCamera<PosedFrame>, CalibrateError> {
    let _stage = options.progress.stage("comparison of lenses");
    let with_lens = |model: &LensModel| CameraOptions { lens: model.name.to_owned(), ..options.clone() };
    let models = lens_models(&options.register);
    let fits: Vec<_> = models.par_iter().map(|model| fit(capture, &with_lens(model))).collect();
    // Frames and markers that the best fit did not take for misdetected: the same for all.
    let best = fits
        .iter()
        .filter_map(|f| f.as_ref().ok())
        .min_by(|a, b| a.reprojection_rms_px.total_cmp(&b.reprojection_rms_px));
    let Some(best) = best else {
        return fits.into_iter().next_back().unwrap_or_else(|| fit(capture, &with_lens(&models[0])));
    };
    let mut common = capture.with_frames(Vec::new());
    common.frames = best.capture.frames.iter().map(|f| f.detected.clone()).collect();
    let costs: Vec<Result<Vec<f64>, String>> = models
        .par_iter()
        .zip(&fits)
        .map(|(model, whole)| match whole {
            Ok(whole) => held_out_costs(&common, &whole.camera, &with_lens(model), fit),
            Err(error) => Err(error.to_string()),
        })
        .collect();
    let comparison = compared(&models, &costs, &fits, common.frames.iter().map(|f| f.markers.len()).sum());
    info!("{}", in_words(&comparison));
    let place = models.iter().position(|m| m.name == comparison.chosen).unwrap_or(0);
    let chosen = fits.into_iter().nth(place).unwrap_or_else(|| fit(capture, &with_lens(&models[place])))?;
    Ok(CalibratedCamera { lens_comparison: Some(comparison), ..chosen })
}

/// Squared reprojection error (px²) of every frame under cameras that were fitted without it, frame by frame.
fn held_out_costs(
    capture: &CameraFrames,
    camera: &Camera,
    options: &CameraOptions,
    fit: &Fit<'_>,
) -> Result<Vec<f64>, String> {
    let folds = FOLDS.min(capture.frames.len());
    let options = CameraOptions { camera: Some(camera.clone()), ..options.clone() };
    let cameras: Result<Vec<Camera>, String> = (0..folds)
        .into_par_iter()
        .map(|fold| match fit(&capture.subset(|i, _| i % folds != fold), &options) {
            Ok(fitted) => Ok(fitted.camera),
            Err(error) => Err(format!("without every {folds}th frame: {error}")),
        })
        .collect();
    let cameras = cameras?;
    let cost = |(i, frame): (usize, &crate::observe::DetectedFrame)| {
        let posed =
            estimate_pose(&cameras[i % folds], &capture.target, &markers_of(frame)).map_err(|e| e.to_string())?;
        Ok(posed.rms_px * posed.rms_px * frame.markers.len() as f64)
    };
    capture.frames.iter().enumerate().map(cost).collect()
}

/// The comparison, given every model's costs by frame.
fn compared(
    models: &[LensModel],
    costs: &[Result<Vec<f64>, String>],
    fits: &[Result<CalibratedCamera<PosedFrame>, CalibrateError>],
    markers: usize,
) -> LensComparison {
    let sum = |costs: &[f64]| costs.iter().sum::<f64>();
    let usable = || costs.iter().filter_map(|c| c.as_deref().ok());
    let best = usable().min_by(|a, b| sum(a).total_cmp(&sum(b))).unwrap_or_default();
    let lenses: Vec<ComparedLens> = models
        .iter()
        .zip(costs)
        .zip(fits)
        .map(|((model, costs), fit)| ComparedLens {
            lens: model.name.to_owned(),
            parameters: model.parameters,
            held_out_px: costs.as_ref().ok().map(|c| (sum(c) / markers.max(1) as f64).sqrt()),
            worse_by_standard_errors: costs.as_ref().ok().map(|c| errors_worse(best, c)),
            one_to_one: fit.as_ref().is_ok_and(|fit| one_to_one(&fit.camera)),
            failed: costs.as_ref().err().cloned(),
        })
        .collect();
    let is_good = |lens: &&ComparedLens| lens.worse_by_standard_errors.is_some_and(|w| w <= EQUAL_STANDARD_ERRORS);
    let chosen = lenses.iter().filter(is_good).find(|lens| lens.one_to_one).or_else(|| lenses.iter().find(is_good));
    let chosen = chosen.map_or_else(|| "none".to_owned(), |lens| lens.lens.clone());
    LensComparison { chosen, lenses }
}

/// The comparison in a sentence.
fn in_words(comparison: &LensComparison) -> String {
    let error = |lens: &ComparedLens| match lens.held_out_px {
        Some(px) => format!("{}: {px:.3} px", lens.lens),
        None => format!("{}: not fitted", lens.lens),
    };
    let errors: Vec<String> = comparison.lenses.iter().map(error).collect();
    format!("lens {} is fitted; errors on left-out frames: {}", comparison.chosen, errors.join(", "))
}
