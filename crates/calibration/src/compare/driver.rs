//! The comparison: every variant fitted and evaluated, then ranked.

use depthcal_io::{Comparison, ModelComparison};
use rayon::prelude::*;

use super::errors::{FrameErrors, errors, frame_errors};
use super::image_calibrations::ImageCalibrations;
use super::information_criteria::{JointFit, effective_parameters};
use super::learning_curve::learning_curve;
use super::options::CompareOptions;
use super::ranking::{EvaluatedVariant, rank};
use super::stability::stability;
use super::variants::{Variant, thesis_variants};
use super::verdict::verdict;
use crate::calibrate::{CalibrateError, CalibratedCamera, Estimator, check_declared_depth};
use crate::judge::camera::{EvaluatedCamera, OnePart, evaluate_part};
use crate::judge::cross_validation::thinning;
use crate::observe::CameraFrames;

/// Board pixels of a frame on which models are compared, about: a board that fills the image has ten times as many, which would
/// take as much longer and say the same.
const COMPARED_PIXELS: usize = 20_000;

/// Fits depth models to `train` and compares their errors on `verify`; where that is empty, on held-out frames of `train`.
/// Returns the record and the fit of the best model to all frames, where one could be fitted.
///
/// # Errors
///
/// [`CalibrateError`] where a model's name is wrong, or where depth contradicts the boards that the images show. Models that
/// cannot be fitted are listed with the reason.
pub fn compare(
    train: &CameraFrames,
    verify: &[CameraFrames],
    options: &CompareOptions,
) -> Result<(Comparison, Option<CalibratedCamera>), CalibrateError> {
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
    let from_images = base.progress.stage("image calibration");
    let lenses = lenses(&variants);
    let whole = ImageCalibrations::new(train.clone(), &lenses, base);
    // Every model would fail for the same reason, or, which is worse, not fail.
    if let Some(Ok(from_images)) = whole.by_lens.values().find(|calibrated| calibrated.is_ok()) {
        for capture in std::iter::once(train).chain(verify) {
            check_declared_depth(&from_images.camera, capture, base)?;
        }
    }
    let folds = if verify.is_empty() { folds(train, &lenses, options) } else { Vec::new() };
    drop(from_images);
    let judging = Judging { whole: &whole, folds, verify, options };
    let job = base.progress.steps("fitting models", variants.len());
    let fit_and_judge = |variant: &Variant| {
        let fit = whole.fit(variant, base);
        let evaluated = judging.evaluated(variant, &fit);
        job.advance();
        (evaluated, fit)
    };
    let (evaluated, mut fits): (Vec<EvaluatedVariant>, Vec<_>) = variants.par_iter().map(fit_and_judge).unzip();
    drop(job);
    let (models, variants) = rank(evaluated, listed);
    fits.truncate(listed);
    let learning_curve = learning_curve(train, &fits, verify, options);
    let best = models.first().and_then(|best| options.models.iter().position(|model| *model == best.model));
    let best = best.and_then(|place| fits.swap_remove(place).ok());
    let mut comparison = Comparison {
        train: train.name.clone(),
        verify: verify.iter().map(|c| c.name.clone()).collect(),
        verdict: verdict(&models),
        models,
        variants,
        learning_curve,
        stability: None,
    };
    if options.thesis && !verify.is_empty() {
        let _stage = base.progress.stage("stability of D");
        comparison.stability = stability(train, verify, &whole, base);
    }
    Ok((comparison, best))
}

/// The lens models of variants, each once.
fn lenses(variants: &[Variant]) -> Vec<&str> {
    let mut lenses: Vec<&str> = variants.iter().map(|v| v.lens.as_str()).collect();
    lenses.sort_unstable();
    lenses.dedup();
    lenses
}

/// Of a cross-validation, the other frames' calibrations from the images and the held-out frames of every fold.
fn folds(train: &CameraFrames, lenses: &[&str], options: &CompareOptions) -> Vec<(ImageCalibrations, CameraFrames)> {
    let part = |fold: usize| {
        let training = train.subset(|i, _| i % options.folds != fold);
        let held_out = train.subset(|i, _| i % options.folds == fold);
        (ImageCalibrations::new(training, lenses, &options.calibrate), held_out)
    };
    (0..options.folds).into_par_iter().map(part).collect()
}

/// The frames and calibrations that variants are judged on.
struct Judging<'a> {
    whole: &'a ImageCalibrations,
    folds: Vec<(ImageCalibrations, CameraFrames)>,
    verify: &'a [CameraFrames],
    options: &'a CompareOptions,
}

impl Judging<'_> {
    /// Evaluates a variant; where it was not fitted, or not without held-out frames, its record has the reason.
    fn evaluated(&self, variant: &Variant, fit: &Result<CalibratedCamera, String>) -> EvaluatedVariant {
        let record = ModelComparison {
            model: variant.model.clone(),
            lens: variant.lens.clone(),
            estimator: variant.estimator.to_owned(),
            ..ModelComparison::default()
        };
        let evaluated = fit.as_ref().map_err(String::clone).and_then(|fit| self.evaluate(variant, fit, record.clone()));
        evaluated.unwrap_or_else(|reason| EvaluatedVariant {
            record: ModelComparison { failed: Some(reason), ..record },
            held_out: Vec::new(),
            joint: None,
        })
    }

    fn evaluate(
        &self,
        variant: &Variant,
        fit: &CalibratedCamera,
        mut record: ModelComparison,
    ) -> Result<EvaluatedVariant, String> {
        record.parameters = fit.camera.blocks().iter().map(|b| b.free.iter().filter(|f| **f).count()).sum();
        record.effective_parameters = effective_parameters(fit);
        let thinning = thinning(fit, COMPARED_PIXELS);
        let evaluate = |fit: &CalibratedCamera, capture: &CameraFrames| {
            evaluate_part(&fit.camera, capture, &OnePart::of(thinning, capture.frames.len()))
        };
        let on_train = evaluate(fit, &self.whole.capture);
        record.fit = errors(&[frame_errors(&on_train)]);
        let mut evaluations = vec![on_train];
        if self.verify.is_empty() {
            let name = format!("{} (frames left out)", self.whole.capture.name);
            let judged = |(others, held): &(ImageCalibrations, CameraFrames)| {
                Ok(evaluate(&others.fit_part(fit, variant, &self.options.calibrate)?, held))
            };
            let held_out = joined(self.folds.par_iter().map(judged).collect::<Result<_, String>>()?);
            evaluations.push(EvaluatedCamera { name, ..held_out });
        } else {
            evaluations.extend(self.verify.par_iter().map(|c| evaluate(fit, c)).collect::<Vec<_>>());
        }
        record.per_dataset = evaluations.iter().map(EvaluatedCamera::errors).collect();
        let held_out: Vec<Vec<FrameErrors>> = evaluations[1..].iter().map(frame_errors).collect();
        let [refused, all] =
            held_out.iter().flatten().fold([0, 0], |[r, a], f| [r + f.uncorrectable[0], a + f.uncorrectable[1]]);
        record.not_correctable = refused as f64 / all.max(1) as f64;
        let joint = JointFit::of(fit, record.effective_parameters);
        Ok(EvaluatedVariant { record, held_out, joint })
    }
}

/// The frames of all folds, by name.
fn joined(folds: Vec<EvaluatedCamera>) -> EvaluatedCamera {
    let mut all = EvaluatedCamera { name: String::new(), frames: Vec::new(), dropped: Vec::new() };
    for fold in folds {
        all.frames.extend(fold.frames);
        all.dropped.extend(fold.dropped);
    }
    all.frames.sort_by(|a, b| a.name.cmp(&b.name));
    all
}
