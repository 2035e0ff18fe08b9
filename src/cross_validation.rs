//! Errors on frames that a fit did not see.

use depthcal_io::{GainInterval, HeldOutErrors};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::calibrate::{CalibrateError, CalibrateOptions, calibrate};
use crate::evaluate::{Evaluated, EvaluatedFrame, evaluate};
use crate::noise::DepthNoise;
use crate::observations::Capture;
use crate::progress::Progress;

/// The frames to fit and those held out: every `every`-th, counted from `first`.
pub fn split(capture: &Capture, every: usize, first: usize) -> (Capture, Capture) {
    let held = |i: usize| i % every == first;
    let mut rest = capture.subset(|i, _| held(i));
    rest.dropped.clear();
    (capture.subset(|i, _| !held(i)), rest)
}

/// Every frame of a capture, evaluated by a fit that did not see it: `folds` fits, each without every `folds`-th frame.
///
/// # Errors
///
/// [`CalibrateError`] of any of the fits.
pub fn cross_validate(
    capture: &Capture,
    folds: usize,
    options: &CalibrateOptions,
) -> Result<Evaluated, CalibrateError> {
    let progress = Progress::new("cross-validating", folds);
    let mut all = Evaluated { name: capture.name.clone(), frames: Vec::new(), dropped: Vec::new() };
    for first in 0..folds {
        let (fitted, held) = split(capture, folds, first);
        let evaluated = evaluate(&calibrate(&fitted, options)?.camera, &held);
        all.frames.extend(evaluated.frames);
        all.dropped.extend(evaluated.dropped);
        progress.advance();
    }
    all.frames.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(all)
}

/// The errors after correction, one number each.
pub fn errors(evaluated: &Evaluated) -> HeldOutErrors {
    let record = evaluated.record();
    HeldOutErrors {
        dot_error_mm: record.dot_error_mm.map(|e| e.after.mean),
        plane_error_mm: record.plane_error_mm.map(|e| e.after.mean),
        depth_rms_mm: record.depth_rms_mm.map(|e| e.after),
        reprojection_px: record.reprojection_px.rms,
    }
}

/// Root mean square of the corrected depth's errors in standard deviations of the noise, which counts near pixels as much as
/// far ones; `None` without depth.
pub fn weighted_depth_rms(evaluated: &Evaluated, noise: &DepthNoise) -> Option<f64> {
    let pixels = || evaluated.frames.iter().flat_map(|f| f.pixels.iter());
    // A depth error e has the size e ρ² in inverse depth.
    let weighted = pixels().map(|p| {
        let rho = 1.0 / p.board_depth_mm;
        (p.after_mm * rho * rho / noise.sigma(rho)).clamp(-MOST_SIGMAS, MOST_SIGMAS)
    });
    let (sum, n) = weighted.fold((0.0, 0_usize), |(s, n), e| (s + e * e, n + 1));
    (n > 0).then(|| (sum / n as f64).sqrt())
}

/// Pixels count as no worse than this many standard deviations in a weighted mean.
const MOST_SIGMAS: f64 = 8.0;

/// Resamples for intervals.
const RESAMPLES: usize = 1000;

/// Fall of the root mean square depth error from one model to another on the same frames, per cent, with its 95 %
/// interval: frames are resampled in pairs (Efron, Tibshirani 1993, chapter 13). `None` without depth.
pub fn depth_gain_percent(before: &Evaluated, after: &Evaluated) -> Option<GainInterval> {
    let squares = |f: &EvaluatedFrame| {
        let sum: f64 = f.pixels.iter().map(|p| p.after_mm * p.after_mm).sum();
        (sum, f.pixels.len() as f64)
    };
    let pairs: Vec<[(f64, f64); 2]> = before
        .frames
        .iter()
        .filter_map(|b| Some([squares(b), squares(after.frames.iter().find(|a| a.name == b.name)?)]))
        .filter(|[b, a]| b.1 > 0.0 && a.1 > 0.0)
        .collect();
    if pairs.is_empty() {
        return None;
    }
    let gain = |pick: &mut dyn FnMut(usize) -> usize| {
        let mut sums = [(0.0, 0.0); 2];
        for i in 0..pairs.len() {
            for (sum, part) in sums.iter_mut().zip(pairs[pick(i)]) {
                *sum = (sum.0 + part.0, sum.1 + part.1);
            }
        }
        let [b, a] = sums.map(|(squares, n)| (squares / n).sqrt());
        100.0 * (1.0 - a / b)
    };
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut resampled: Vec<f64> = (0..RESAMPLES).map(|_| gain(&mut |_| rng.random_range(0..pairs.len()))).collect();
    resampled.sort_by(f64::total_cmp);
    let at = |q: f64| resampled[(q * (RESAMPLES - 1) as f64).round() as usize];
    Some(GainInterval { value: gain(&mut |i| i), low: at(0.025), high: at(0.975) })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn evaluated(errors_mm: &[f64]) -> Evaluated {
        let frames = errors_mm.iter().enumerate().map(|(i, e)| EvaluatedFrame {
            name: format!("{i:03}"),
            camera_from_board: nalgebra::Isometry3::identity(),
            reprojection: Vec::new(),
            dots: Vec::new(),
            pixels: vec![
                crate::evaluate::PixelError {
                    context: depthcal_model::Context::default(),
                    board_depth_mm: 1000.0,
                    board: [0.0; 2],
                    cos_incidence: 1.0,
                    before_mm: *e,
                    after_mm: *e,
                    height_before_mm: *e,
                    height_after_mm: *e,
                };
                10
            ],
            uncorrectable: 0,
        });
        Evaluated { name: "test".into(), frames: frames.collect(), dropped: Vec::new() }
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
    }
}
