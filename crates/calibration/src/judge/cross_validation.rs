//! Cross-validation: errors on frames that a fit did not see, and their bootstrap intervals.

use depthcal_io::{CAMERA, GainInterval, HeldOutErrors};
use depthcal_statistics::{Bootstrap, Thinning};
use rayon::prelude::*;
use tracing::debug;

use super::camera::{EvaluatedCamera, EvaluatedFrame, OnePart, evaluate_part, uncorrected};
use super::evaluate::{Evaluated, NotFitted};
use super::linearity::is_linear;
use super::parts::{Parts, parts_of};
use crate::adjust::leave_out::{camera_of_frames, cameras_without_parts};
use crate::calibrate::{
    CalibrateError, CalibratedCamera, CameraOptions, Estimator, calibrate_camera, has_fields, readjust,
};
use crate::observe::board_pixels::board_area_px;
use crate::observe::board_region::BoardRegion;
use crate::observe::noise::DepthNoise;
use crate::observe::{CameraFrames, PixelRays, SampledFrame};

/// The frames to fit and the held-out ones, every `every`-th counted from `first`.
pub fn split(capture: &CameraFrames, every: usize, first: usize) -> (CameraFrames, CameraFrames) {
    let held = |i: usize| i % every == first;
    let mut held_out = capture.subset(|i, _| held(i));
    held_out.dropped.clear();
    (capture.subset(|i, _| !held(i)), held_out)
}

/// Errors of every frame of a fit under a model that was adjusted without it: the model of `options`, adjusted again without each
/// of so many parts of the frames, starting from `fit`. Where it cannot be adjusted without a part, the part's frames are dropped
/// with the reason.
///
/// # Errors
///
/// [`CalibrateError`] if no fold could be fitted.
pub fn cross_validate_camera(
    fit: &CalibratedCamera,
    parts: usize,
    how: Parts,
    options: &CameraOptions,
) -> Result<EvaluatedCamera, CalibrateError> {
    cross_validate_thinned(fit, parts, how, usize::MAX, options)
}

/// [`cross_validate_camera`] judged on about `most_pixels` board pixels of a frame on average: enough to compare models. Frames
/// have the weight that they have with all their pixels.
///
/// # Errors
///
/// [`CalibrateError`] if no fold could be fitted.
pub fn cross_validate_thinned(
    fit: &CalibratedCamera,
    parts: usize,
    how: Parts,
    most_pixels: usize,
    options: &CameraOptions,
) -> Result<EvaluatedCamera, CalibrateError> {
    let job = options.progress.steps("cross-validating", parts);
    let markers: Vec<usize> = fit.capture.frames.iter().map(|f| f.markers.len()).collect();
    let part_of = parts_of(&markers, parts, how);
    let priors = (&fit.smoothness, fit.prior.as_deref());
    let is_joint = options.estimator == Estimator::Joint && fit.with_depth;
    // The smoothness of fields is chosen anew without each part.
    let steps = if is_joint && !has_fields(options)? {
        cameras_without_parts(&fit.capture, &fit.camera, &fit.noise, priors, &part_of, parts)
    } else {
        vec![None; parts]
    };
    let thinning = thinning(fit, most_pixels);
    let bare = uncorrected(&fit.camera);
    let of_a_part = most_pixels.saturating_mul(markers.len().div_ceil(parts.max(1)));
    let are_few = of_a_part < bare.width * bare.height / PIXELS_OF_A_RAY;
    let rays = are_few.then(|| PixelRays::new(&bare, &fit.capture.target));
    let judged = OnePart { similar: rays.as_ref(), ..OnePart::of(thinning, markers.len()) };
    let of_part = |part: usize| {
        let mut held = fit.capture.subset(|i, _| part_of[i] == part);
        held.dropped.clear();
        let others = || fit.capture.subset(|i, _| part_of[i] != part);
        let near = match &steps[part] {
            Some(camera) if is_linear(fit, camera) => Some(camera.clone()),
            // One step does not lead to the optimum without the part.
            Some(_) => {
                debug!("without part {part} of the frames the model is adjusted");
                camera_of_frames(&others(), &fit.camera, &fit.noise, priors)
            }
            None => None,
        };
        let camera = match near {
            Some(camera) => Ok(camera),
            None if is_joint => readjust(fit, others(), options).map(|fit| fit.camera),
            None => calibrate_camera(&others().detected(), options).map(|fit| fit.camera),
        };
        let evaluated = camera
            .map(|camera| Evaluated::of_camera(CAMERA, evaluate_part(&camera, &held, &judged)))
            .map_err(|error| {
                let names = held.frames.iter().map(|frame| frame.name.clone()).collect();
                Box::new(NotFitted { error, frames: vec![(CAMERA.to_owned(), names)] })
            });
        job.advance();
        evaluated
    };
    let evaluated = (0..parts).into_par_iter().map(of_part).collect();
    let none = EvaluatedCamera { name: fit.capture.name.clone(), frames: Vec::new(), dropped: Vec::new() };
    let mut all = Evaluated::of_camera(CAMERA, none).joined(evaluated, "model")?;
    Ok(all.cameras.swap_remove(0).1)
}

/// Which pixels are judged where about `most` of a frame are wanted on average: the same share of every frame's.
pub(crate) fn thinning(fit: &CalibratedCamera, most: usize) -> Thinning {
    let frames = &fit.capture.frames;
    // Where frames have single pixels instead of images, these are all judged.
    if frames.iter().any(|f| !f.raw.depth_pixels().is_empty()) {
        return Thinning::ALL;
    }
    let area = |f: &SampledFrame| {
        let region = BoardRegion::within_markers(&fit.capture.target, &f.markers);
        board_area_px(&fit.camera, &region, &f.camera_from_board)
    };
    Thinning::new(frames.iter().map(area).sum(), most.saturating_mul(frames.len()))
}

/// The errors after correction, one number of each kind.
pub fn errors(evaluated: &EvaluatedCamera) -> HeldOutErrors {
    let record = evaluated.errors();
    HeldOutErrors {
        dot_error_mm: record.dot_error_mm.map(|e| e.after.mean),
        plane_error_mm: record.plane_error_mm.map(|e| e.after.mean),
        depth_rms_mm: record.depth_rms_mm.map(|e| e.after),
        reprojection_px: record.reprojection_px.map(|e| e.rms),
        outliers: record.outliers,
    }
}

/// Standard deviations at which errors are clipped in the weighted mean: single outliers do not decide.
const MOST_SIGMAS: f64 = 8.0;

/// Pixels of an image whose rays are computed together in the time of a single one.
const PIXELS_OF_A_RAY: usize = 8;

/// Whole frames are drawn, because the pixels of a frame share errors.
const BOOTSTRAP: Bootstrap = Bootstrap::OVER_FRAMES;

/// Blocks of consecutive frames into which a recording is divided where time matters.
const BLOCKS_OF_TIME: usize = 10;

/// Sum of a frame's squared depth errors after correction, mm², and their number.
fn squares(f: &EvaluatedFrame) -> (f64, f64) {
    (f.depth.depth.after.squares_mm2, f.depth.pixels as f64)
}

/// Root mean square over frames, given the sum of squares and the number of each.
fn pooled_rms(frames: impl Iterator<Item = (f64, f64)>) -> f64 {
    let (sum, n) = frames.fold((0.0, 0.0), |(sum, n), (squares, count)| (sum + squares, n + count));
    (sum / n).sqrt()
}

/// The frames of two evaluations that both have, in pairs.
fn pairs<'a>(before: &'a EvaluatedCamera, after: &'a EvaluatedCamera) -> impl Iterator<Item = [&'a EvaluatedFrame; 2]> {
    let after_of = |b: &EvaluatedFrame| after.frames.iter().find(|a| a.name == b.name);
    before.frames.iter().filter_map(move |b| Some([b, after_of(b)?]))
}

/// A gain over `count` pairs of frames, which are resampled; `None` of no pairs.
fn gain_over(count: usize, percent: impl Fn(&[usize]) -> f64) -> Option<GainInterval> {
    let gain = (count > 0).then(|| BOOTSTRAP.estimate(count, percent))?;
    Some(GainInterval { value: gain.value, low: gain.low, high: gain.high })
}

/// Fall from one root mean square to another, per cent; 0 where there is nothing to fall.
fn fall_percent([before, after]: [f64; 2]) -> f64 {
    if before > 0.0 { 100.0 * (1.0 - after / before) } else { 0.0 }
}

/// Fall of the root mean square depth error from one model to another on the same frames, per cent, with its 95 %
/// interval over frames, which are resampled in pairs. `None` without depth.
pub fn depth_gain_percent(before: &EvaluatedCamera, after: &EvaluatedCamera) -> Option<GainInterval> {
    let pairs: Vec<[(f64, f64); 2]> =
        pairs(before, after).map(|p| p.map(squares)).filter(|[b, a]| b.1 > 0.0 && a.1 > 0.0).collect();
    let side = |drawn: &[usize], i: usize| pooled_rms(drawn.iter().map(|d| pairs[*d][i]));
    gain_over(pairs.len(), |drawn| fall_percent([side(drawn, 0), side(drawn, 1)]))
}

/// Fall of the mean dot error after correction from one model to another on the same frames, per cent, with its 95 % interval
/// over frames. `None` without depth at markers.
pub fn dot_gain_percent(before: &EvaluatedCamera, after: &EvaluatedCamera) -> Option<GainInterval> {
    let sum = |f: &EvaluatedFrame| (f.dots.iter().map(|d| d[1]).sum::<f64>(), f.dots.len() as f64);
    let pairs: Vec<[(f64, f64); 2]> =
        pairs(before, after).map(|p| p.map(sum)).filter(|[b, a]| b.1 > 0.0 && a.1 > 0.0).collect();
    let side = |drawn: &[usize], i: usize| {
        let (sum, n) = drawn.iter().map(|d| pairs[*d][i]).fold((0.0, 0.0), |(s, n), v| (s + v.0, n + v.1));
        sum / n
    };
    gain_over(pairs.len(), |drawn| fall_percent([side(drawn, 0), side(drawn, 1)]))
}

/// Fall of the product of two errors, per cent, with its 95 % interval over frames: of depth weighted by the noise, so that near
/// pixels, where noise is small, count as much as far ones, and of reprojection. Every frame counts alike, by the geometric mean
/// of the frames' errors: a frame far outside the others' poses, which they do not determine, decides nothing alone.
pub fn weighted_gain_percent(
    before: &EvaluatedCamera,
    after: &EvaluatedCamera,
    noise: &DepthNoise,
) -> Option<GainInterval> {
    let falls = weighted_falls(before, after, noise);
    gain_over(falls.len(), |drawn| mean_fall_percent(drawn.iter().map(|d| falls[*d])))
}

/// [`weighted_gain_percent`] with its interval over blocks of consecutive frames, which are resampled whole: what a function of
/// time takes up in one stretch of a recording may be anything that happened there.
pub fn weighted_gain_of_blocks_percent(
    before: &EvaluatedCamera,
    after: &EvaluatedCamera,
    noise: &DepthNoise,
) -> Option<GainInterval> {
    let falls = weighted_falls(before, after, noise);
    let blocks: Vec<&[[f64; 2]]> = falls.chunks(falls.len().div_ceil(BLOCKS_OF_TIME).max(1)).collect();
    gain_over(blocks.len(), |drawn| mean_fall_percent(drawn.iter().flat_map(|d| blocks[*d].iter().copied())))
}

/// Fall of the product of both kinds of error, per cent, over frames given by the logarithms of their ratios.
fn mean_fall_percent(frames: impl Iterator<Item = [f64; 2]>) -> f64 {
    let (sum, n) = frames.fold((0.0, 0.0), |(sum, n), f| (sum + f[0] + f[1], n + 1.0));
    100.0 * (1.0 - (sum / n).exp())
}

/// Logarithms of the ratio of every frame's weighted depth errors after and before, and of its reprojection errors; in the order
/// of the frames.
fn weighted_falls(before: &EvaluatedCamera, after: &EvaluatedCamera, noise: &DepthNoise) -> Vec<[f64; 2]> {
    let logarithm = |[before, after]: [(f64, f64); 2]| {
        let ratio = pooled_rms([after].into_iter()) / pooled_rms([before].into_iter());
        if ratio.is_finite() && ratio > 0.0 { ratio.ln() } else { 0.0 }
    };
    weighted_pairs(before, after, noise).into_iter().map(|kinds| kinds.map(logarithm)).collect()
}

/// Sum and number of the squared weighted depth errors and of the squared reprojection errors of every frame, before and after.
fn weighted_pairs(before: &EvaluatedCamera, after: &EvaluatedCamera, noise: &DepthNoise) -> Vec<[[(f64, f64); 2]; 2]> {
    let weighted = |f: &EvaluatedFrame| {
        // A depth error e has the size e ρ² in inverse depth.
        let of_noise = f.pixels.iter().map(|p| {
            let rho = 1.0 / p.board_depth_mm;
            (p.after_mm * rho * rho / noise.sigma(rho)).clamp(-MOST_SIGMAS, MOST_SIGMAS)
        });
        of_noise.fold((0.0, 0.0), |(s, n), e| (s + e * e, n + 1.0))
    };
    let reprojection = |f: &EvaluatedFrame| {
        let squares = f.reprojection.iter().map(|e| e[2] * e[2] + e[3] * e[3]);
        (squares.sum::<f64>(), f.reprojection.len() as f64)
    };
    pairs(before, after).map(|p| [p.map(weighted), p.map(reprojection)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn evaluated(errors_mm: &[f64]) -> EvaluatedCamera {
        let frames = errors_mm.iter().enumerate();
        let frames = frames.map(|(i, e)| EvaluatedFrame::of_depth_errors(format!("{i:03}"), &[*e; 10]));
        EvaluatedCamera { name: "test".into(), frames: frames.collect(), dropped: Vec::new() }
    }

    #[test]
    fn gains_and_their_intervals() {
        let before = evaluated(&[2.0; 20]);
        let half = depth_gain_percent(&before, &evaluated(&[1.0; 20])).unwrap();
        assert!((half.value - 50.0).abs() < 1e-12 && (half.low - 50.0).abs() < 1e-12, "{half:?}");
        // One frame of twenty gains everything: the interval reaches to no gain at all.
        let mut one = [2.0; 20];
        one[7] = 0.0;
        let lucky = depth_gain_percent(&before, &evaluated(&one)).unwrap();
        assert!(lucky.low.abs() < 1e-9 && lucky.high > lucky.value && lucky.value > 0.0, "{lucky:?}");
        // Nineteen frames improve by a fifth, the twentieth becomes three times as bad: the whole by less than its uncertainty,
        // the frames for certain.
        let noise = DepthNoise { a_per_mm: 1e-6, b_mm: 0.0 };
        let (mut before, mut after) = ([1.0; 20], [0.8; 20]);
        (before[3], after[3]) = (2.0, 6.0);
        let (before, after) = (evaluated(&before), evaluated(&after));
        let pooled = depth_gain_percent(&before, &after).unwrap();
        let weighted = weighted_gain_percent(&before, &after, &noise).unwrap();
        assert!(pooled.low < 0.0 && weighted.low > 0.0, "{pooled:?} {weighted:?}");
        let expected = 100.0 * (1.0 - ((19.0 * 0.8_f64.ln() + 3.0_f64.ln()) / 20.0).exp());
        assert!((weighted.value - expected).abs() < 1e-9, "{weighted:?}");
    }
}
