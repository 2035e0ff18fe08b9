//! Errors on left-out frames of a camera whose board the other cameras place.

use std::collections::BTreeMap;

use depthcal_io::{GainInterval, RigLeftOut};
use depthcal_statistics::Bootstrap;
use nalgebra::Isometry3;

use crate::adjust::adjustment::Adjustment;
use crate::adjust::state::State;
use crate::diagnose::DiagnoseError;

/// Decrease of the cost by a step below which an adjustment ends.
pub(super) const DECREASE: f64 = 1e-4;

/// Errors of two models of a rig, whose frames are the same, on frames that are left out, one in so many as there are folds at a
/// time. `None` where no other camera places the board.
///
/// # Errors
///
/// [`DiagnoseError`] of an adjustment.
pub(super) fn left_out(models: [&State; 2], camera: usize, folds: usize) -> Result<Option<RigLeftOut>, DiagnoseError> {
    // Sums of squares before and after, and the number of observations, by frame.
    let mut frames: BTreeMap<usize, ([f64; 2], usize)> = BTreeMap::new();
    for fold in 0..folds {
        let held: Vec<bool> = (0..models[0].frames.len()).map(|i| i % folds == fold).collect();
        for (model, whole) in models.iter().enumerate() {
            let mut fitted = whole.subset(|i| !held[i]);
            let adjusted = Adjustment::of_state(&fitted, true)?.refine_within(DECREASE)?;
            adjusted.give(&mut fitted);
            let numbers: Vec<usize> = (0..held.len()).filter(|i| held[*i]).collect();
            for (frame, squares, count) in errors_given_the_others(&whole.subset(|i| held[i]), &fitted, camera)? {
                let entry = frames.entry(numbers[frame]).or_default();
                // Of as many observations as the first model has: the second may have dropped other outliers.
                let first = if model == 0 { count } else { entry.1 };
                entry.0[model] = squares * first as f64 / count as f64;
                entry.1 = first;
            }
        }
    }
    let total: usize = frames.values().map(|f| f.1).sum();
    if total == 0 {
        return Ok(None);
    }
    let sums: Vec<[f64; 2]> = frames.values().map(|f| f.0).collect();
    let sum = |picked: &[usize], model: usize| picked.iter().map(|i| sums[*i][model]).sum::<f64>();
    let all: Vec<usize> = (0..sums.len()).collect();
    let gain = |picked: &[usize]| 100.0 * (1.0 - (sum(picked, 1) / sum(picked, 0)).sqrt());
    let estimate = Bootstrap::OVER_FRAMES.estimate(sums.len(), gain);
    Ok(Some(RigLeftOut {
        before: (sum(&all, 0) / total as f64).sqrt(),
        after: (sum(&all, 1) / total as f64).sqrt(),
        gain_percent: GainInterval { value: estimate.value, low: estimate.low, high: estimate.high },
    }))
}

/// Squared whitened residuals of a camera, summed, and their number, of every frame of `held` whose board other cameras place;
/// all cameras as `fitted` has them.
fn errors_given_the_others(
    held: &State,
    fitted: &State,
    camera: usize,
) -> Result<Vec<(usize, f64, usize)>, DiagnoseError> {
    let mut given = held.clone();
    for (own, from) in given.cameras.iter_mut().zip(&fitted.cameras) {
        own.camera = from.camera.clone();
        (own.camera_from_rig, own.drift, own.offset_s) = (from.camera_from_rig, from.drift, from.offset_s);
    }
    given.place_boards();
    let mut others = given.clone();
    others.cameras[camera].capture.frames.clear();
    others.cameras[camera].frames.clear();
    let mut adjustment = Adjustment::of_state(&others, true)?;
    adjustment.hold_cameras();
    let poses: Vec<Isometry3<f64>> = adjustment.refine_within(DECREASE)?.rig_from_board;
    for (frame, pose) in given.frames.iter_mut().zip(&poses) {
        frame.rig_from_board = *pose;
    }
    given.place_boards();
    let seen_by_others = |number: &usize| {
        others
            .cameras
            .iter()
            .any(|c| c.frames.iter().zip(&c.capture.frames).any(|(f, frame)| f == number && !frame.markers.is_empty()))
    };
    let [image, depth] = Adjustment::of_state(&given, true)?.whitened(camera);
    let judged = &given.cameras[camera];
    let by_markers = judged.has_markers();
    let mut residuals = if by_markers { image.iter() } else { depth.iter() };
    let mut errors = Vec::new();
    for (number, frame) in judged.frames.iter().zip(&judged.capture.frames) {
        let count = if by_markers { 2 * frame.markers.len() } else { frame.samples.len() };
        let squares: f64 = residuals.by_ref().take(count).map(|r| r * r).sum();
        if count > 0 && seen_by_others(number) {
            errors.push((*number, squares, count));
        }
    }
    Ok(errors)
}
