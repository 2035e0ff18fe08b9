//! The comparison: every variant fitted and evaluated, then ranked.

use depthcal_io::{Comparison, DatasetEvaluation, ModelComparison};
use depthcal_model::Camera;
use rayon::prelude::*;

use super::errors::{FrameErrors, errors, frame_errors};
use super::image_calibrations::ImageCalibrations;
use super::information_criteria::{Residuals, effective_parameters};
use super::learning_curve::learning_curve;
use super::options::CompareOptions;
use super::ranking::{EvaluatedVariant, rank};
use super::stability::stability;
use super::variants::{Variant, thesis_variants};
use super::verdict::verdict;
use crate::calibrate::{CalibrateError, CameraOptions, Estimator, check_declared_depth};
use crate::judge::camera::{EvaluatedCamera, evaluate_part};
use crate::judge::cross_validation::thinning;
use crate::observe::CameraFrames;

/// Board pixels of a frame on which models are compared, about: a board that fills the image has ten times as many, which would
/// take as much longer and say the same.
const COMPARED_PIXELS: usize = 20_000;

/// Fits depth models to `train` and compares their errors on `verify`; where that is empty, on held-out frames of `train`.
///
/// # Errors
///
/// [`CalibrateError`] where a model's name is wrong, or where depth contradicts the boards that the images show. Models that
/// cannot be fitted are listed with the reason.
pub fn compare(
    train: &CameraFrames,
    verify: &[CameraFrames],
    options: &CompareOptions,
) -> Result<Comparison, CalibrateError> {
    let base = &options.calibrate;
    for model in &options.models {
        base.register.depth_blocks(model)?;
    }
    let mut variants: Vec<Variant> =
        options.models.iter().map(|m| Variant::new(m, &base.lens, Estimator::Joint)).collect();
    let listed = variants.len();
    if options.thesis {
        let listed = variants.clone();
        variants.extend(thesis_variants().into_iter().filter(|v| !listed.contains(v)));
    }
    let mut lenses: Vec<&str> = variants.iter().map(|v| v.lens.as_str()).collect();
    lenses.sort_unstable();
    lenses.dedup();
    let from_images = base.progress.stage("image calibration");
    let whole = ImageCalibrations::new(train.clone(), &lenses, base);
    // Every model would fail for the same reason, or, which is worse, not fail.
    if let Some(Ok(from_images)) = whole.by_lens.values().find(|calibrated| calibrated.is_ok()) {
        for capture in std::iter::once(train).chain(verify) {
            check_declared_depth(&from_images.camera, capture, base)?;
        }
    }
    // Cross-validation: every fold's fit, and the frames that it holds out.
    let folds: Vec<(ImageCalibrations, CameraFrames)> = if verify.is_empty() {
        let part = |fold: usize| {
            let training = train.subset(|i, _| i % options.folds != fold);
            (ImageCalibrations::new(training, &lenses, base), train.subset(|i, _| i % options.folds == fold))
        };
        (0..options.folds).into_par_iter().map(part).collect()
    } else {
        Vec::new()
    };
    drop(from_images);
    let job = base.progress.steps("fitting models", variants.len());
    let evaluated = variants.par_iter().map(|v| {
        let evaluated = evaluate_variant(v, &whole, &folds, verify, base);
        job.advance();
        evaluated
    });
    let evaluated: Vec<EvaluatedVariant> = evaluated.collect();
    drop(job);
    let (models, variants) = rank(evaluated, listed);
    let mut comparison = Comparison {
        train: train.name.clone(),
        verify: verify.iter().map(|c| c.name.clone()).collect(),
        verdict: verdict(&models),
        models,
        variants,
        learning_curve: learning_curve(train, verify, options),
        stability: None,
    };
    if options.thesis && !verify.is_empty() {
        let _stage = base.progress.stage("stability of D");
        comparison.stability = stability(train, verify, &whole, base);
    }
    Ok(comparison)
}

/// Fits and evaluates a variant; where it cannot be fitted its record has the reason.
fn evaluate_variant(
    variant: &Variant,
    whole: &ImageCalibrations,
    folds: &[(ImageCalibrations, CameraFrames)],
    verify: &[CameraFrames],
    base: &CameraOptions,
) -> EvaluatedVariant {
    let mut record = ModelComparison {
        model: variant.model.clone(),
        lens: variant.lens.clone(),
        estimator: variant.estimator.to_owned(),
        ..ModelComparison::default()
    };
    match fit_and_evaluate(variant, whole, folds, verify, base, &mut record) {
        Ok((held_out, residuals)) => EvaluatedVariant { record, held_out, residuals },
        Err(reason) => {
            record.failed = Some(reason);
            EvaluatedVariant { record, held_out: Vec::new(), residuals: None }
        }
    }
}

/// Errors of held-out frames by dataset, and residuals of the fit.
type HeldOutAndResiduals = (Vec<Vec<FrameErrors>>, Option<Residuals>);

fn fit_and_evaluate(
    variant: &Variant,
    whole: &ImageCalibrations,
    folds: &[(ImageCalibrations, CameraFrames)],
    verify: &[CameraFrames],
    base: &CameraOptions,
    record: &mut ModelComparison,
) -> Result<HeldOutAndResiduals, String> {
    let fitted = whole.fit(variant, base)?;
    record.parameters = fitted.camera.blocks().iter().map(|b| b.free.iter().filter(|f| **f).count()).sum();
    record.effective_parameters = effective_parameters(&fitted);
    let thinning = thinning(&fitted, COMPARED_PIXELS);
    let evaluate =
        |camera: &Camera, capture: &CameraFrames| evaluate_part(camera, capture, thinning, capture.frames.len());
    let on_train = evaluate(&fitted.camera, &whole.capture);
    record.fit = errors(&[frame_errors(&on_train)]);
    let mut evaluations = vec![on_train];
    if folds.is_empty() {
        evaluations.extend(verify.par_iter().map(|c| evaluate(&fitted.camera, c)).collect::<Vec<_>>());
    } else {
        let parts: Result<Vec<EvaluatedCamera>, String> =
            folds.par_iter().map(|(rest, held)| Ok(evaluate(&rest.fit(variant, base)?.camera, held))).collect();
        let name = format!("{} (frames left out)", whole.capture.name);
        let mut all = EvaluatedCamera { name, frames: Vec::new(), dropped: Vec::new() };
        for part in parts? {
            all.frames.extend(part.frames);
            all.dropped.extend(part.dropped);
        }
        all.frames.sort_by(|a, b| a.name.cmp(&b.name));
        evaluations.push(all);
    }
    record.per_dataset =
        evaluations.iter().map(|e| DatasetEvaluation { frames_detail: Vec::new(), ..e.record() }).collect();
    let held: Vec<Vec<FrameErrors>> = evaluations[1..].iter().map(frame_errors).collect();
    let [refused, all] =
        held.iter().flatten().fold([0, 0], |[r, a], f| [r + f.uncorrectable[0], a + f.uncorrectable[1]]);
    record.not_correctable = refused as f64 / all.max(1) as f64;
    Ok((held, Residuals::of(&fitted, record.effective_parameters)))
}
