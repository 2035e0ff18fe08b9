//! Errors against the number of frames in the fit: how many captures a model needs.

use depthcal_io::LearningPoint;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::errors::{FrameErrors, errors, frame_errors};
use super::{CompareOptions, Prepared, Variant};
use crate::calibrate::Estimator;
use crate::judge::evaluate::evaluate;
use crate::observe::Capture;

/// Same input, same choice of frames.
const SEED: u64 = 0x6c65_6172_6e00;

/// Frames of the training dataset at random, the same for all models; judged on the other datasets, or, where there are
/// none, on all frames that the fit did not see.
pub(super) fn curve(train: &Capture, verify: &[Capture], options: &CompareOptions) -> Vec<LearningPoint> {
    let total = train.frames.len();
    // Without other datasets some frames must be left to judge by.
    let most = if verify.is_empty() { total.saturating_sub(3) } else { total };
    let mut sizes: Vec<usize> = options.learning_sizes.iter().copied().filter(|n| *n < most).collect();
    if sizes.is_empty() || options.learning_fits == 0 {
        return Vec::new();
    }
    sizes.push(most);
    let mut points = Vec::new();
    let job = options.calibrate.progress.steps("learning curve", sizes.len());
    for size in sizes {
        // The fewer frames are left to judge by, the more often they are drawn.
        let fits = if size == total { 1 } else { options.learning_fits };
        let mut rng = ChaCha8Rng::seed_from_u64(SEED + size as u64);
        let draws: Vec<Vec<bool>> = (0..fits)
            .map(|_| {
                let mut order: Vec<usize> = (0..total).collect();
                order.shuffle(&mut rng);
                let mut chosen = vec![false; total];
                order[..size].iter().for_each(|i| chosen[*i] = true);
                chosen
            })
            .collect();
        // By draw and model.
        let judged: Vec<Vec<Result<Vec<Vec<FrameErrors>>, String>>> = draws
            .par_iter()
            .map(|chosen| {
                let fitted = train.subset(|i, _| chosen[i]);
                let left = [train.subset(|i, _| !chosen[i])];
                let judges = if verify.is_empty() { &left[..] } else { verify };
                let prepared = Prepared::new(fitted, &[options.calibrate.lens.as_str()], &options.calibrate);
                let judge = |model: &String| {
                    let variant = Variant::new(model, &options.calibrate.lens, Estimator::Joint);
                    let camera = prepared.fit(&variant, &options.calibrate)?.camera;
                    Ok(judges.par_iter().map(|c| frame_errors(&evaluate(&camera, c))).collect())
                };
                options.models.par_iter().map(judge).collect()
            })
            .collect();
        for (m, model) in options.models.iter().enumerate() {
            let good: Vec<_> = judged.iter().filter_map(|by_model| by_model[m].as_ref().ok()).collect();
            let mut reasons: Vec<String> =
                judged.iter().filter_map(|by_model| by_model[m].as_ref().err().cloned()).collect();
            reasons.sort_unstable();
            reasons.dedup();
            // Frames that several fits leave out count for each of them.
            let datasets = good.first().map_or(0, |g| g.len());
            let pooled: Vec<Vec<FrameErrors>> =
                (0..datasets).map(|d| good.iter().flat_map(|g| g[d].iter().cloned()).collect()).collect();
            points.push(LearningPoint {
                model: model.clone(),
                frames: size,
                fits,
                failed: fits - good.len(),
                reasons,
                held_out: errors(&pooled),
            });
        }
        job.advance();
    }
    points
}
