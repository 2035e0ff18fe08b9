//! Learning curve: held-out errors against the number of frames in the fit.

use depthcal_io::LearningPoint;
use depthcal_model::ModelSpec;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::errors::{FrameErrors, errors, frame_errors};
use super::image_calibrations::ImageCalibrations;
use super::options::CompareOptions;
use super::variants::Variant;
use crate::calibrate::{CalibratedCamera, Estimator};
use crate::judge::camera::{OnePart, evaluate_part};
use crate::judge::cross_validation::thinning;
use crate::observe::CameraFrames;

/// Seed of the random choice of frames: the same input gives the same choice.
const SEED: u64 = 0x6c65_6172_6e00;

/// Board pixels of a frame on which the fits are judged, about.
const JUDGED_PIXELS: usize = 5000;

/// Errors of fits to random subsets of the training frames, the same subsets for all models, on the other datasets; where
/// there are none, on all training frames that the fit did not see. `fits` are those of the models to all frames.
pub(super) fn learning_curve(
    train: &CameraFrames,
    fits: &[Result<CalibratedCamera, String>],
    verify: &[CameraFrames],
    options: &CompareOptions,
) -> Vec<LearningPoint> {
    let total = train.frames.len();
    // Without other datasets, three frames at least are held out.
    let most = if verify.is_empty() { total.saturating_sub(3) } else { total };
    let mut sizes: Vec<usize> = options.learning_sizes.iter().copied().filter(|n| *n < most).collect();
    if sizes.is_empty() || options.learning_fits == 0 {
        return Vec::new();
    }
    sizes.push(most);
    let mut points = Vec::new();
    let job = options.calibrate.progress.steps("learning curve", sizes.len());
    for size in sizes {
        // All frames can be chosen in one way only.
        let draws = if size == total { 1 } else { options.learning_fits };
        let mut rng = ChaCha8Rng::seed_from_u64(SEED + size as u64);
        let subsets: Vec<Vec<bool>> = (0..draws)
            .map(|_| {
                let mut order: Vec<usize> = (0..total).collect();
                order.shuffle(&mut rng);
                let mut chosen = vec![false; total];
                order[..size].iter().for_each(|i| chosen[*i] = true);
                chosen
            })
            .collect();
        // Errors of the held-out frames of every dataset, or why there is no fit, by draw and model.
        let evaluated: Vec<Vec<Result<Vec<Vec<FrameErrors>>, String>>> = subsets
            .par_iter()
            .map(|chosen| {
                let fitted = train.subset(|i, _| chosen[i]);
                let left = [train.subset(|i, _| !chosen[i])];
                let held_out = if verify.is_empty() { &left[..] } else { verify };
                let from_image = ImageCalibrations::new(fitted, &[options.calibrate.lens.as_str()], &options.calibrate);
                let errors_of = |(model, whole): (&ModelSpec, &Result<CalibratedCamera, String>)| {
                    let variant = Variant::new(model, &options.calibrate.lens, Estimator::Joint);
                    let whole = whole.as_ref().map_err(String::clone)?;
                    let fit = from_image.fit_part(whole, &variant, &options.calibrate)?;
                    let thinning = thinning(&fit, JUDGED_PIXELS);
                    let judged =
                        |c: &CameraFrames| evaluate_part(&fit.camera, c, &OnePart::of(thinning, c.frames.len()));
                    Ok(held_out.par_iter().map(|c| frame_errors(&judged(c))).collect())
                };
                options.models.par_iter().zip(fits).map(errors_of).collect()
            })
            .collect();
        for (m, model) in options.models.iter().enumerate() {
            let good: Vec<_> = evaluated.iter().filter_map(|by_model| by_model[m].as_ref().ok()).collect();
            let mut reasons: Vec<String> =
                evaluated.iter().filter_map(|by_model| by_model[m].as_ref().err().cloned()).collect();
            reasons.sort_unstable();
            reasons.dedup();
            // A frame that several fits hold out counts once for each of them.
            let datasets = good.first().map_or(0, |g| g.len());
            let pooled: Vec<Vec<FrameErrors>> =
                (0..datasets).map(|d| good.iter().flat_map(|g| g[d].iter().cloned()).collect()).collect();
            points.push(LearningPoint {
                model: model.clone(),
                frames: size,
                fits: draws,
                failed: draws - good.len(),
                reasons,
                held_out: errors(&pooled),
            });
        }
        job.advance();
    }
    points
}
