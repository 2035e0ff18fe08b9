//! Depth residuals in their own units, and the samples that no noise explains.

use crate::observe::noise::NoiseModel;
use crate::observe::{AdjustableFrame, Capture};

/// Depth samples beyond this many standard deviations are outliers.
const OUTLIER: f64 = 8.0;

/// (inverse depth, residual in inverse depth) of every sample, 1/mm.
pub(super) fn inverse_depth_residuals<F: AdjustableFrame>(
    capture: &Capture<F>,
    whitened: &[f64],
    noise: &NoiseModel,
) -> Vec<(f64, f64)> {
    let samples = capture.frames.iter().flat_map(|f| f.samples().iter());
    samples
        .zip(whitened)
        .map(|(s, r)| {
            let rho = 1.0 / s.depth_mm;
            (rho, r * noise.depth.sigma(rho))
        })
        .collect()
}

/// Measured minus predicted depth of every sample, mm.
pub(super) fn depth_residuals_mm<F: AdjustableFrame>(
    capture: &Capture<F>,
    whitened: &[f64],
    noise: &NoiseModel,
) -> Vec<f64> {
    inverse_depth_residuals(capture, whitened, noise).iter().map(|(rho, r)| 1.0 / rho - 1.0 / (rho + r)).collect()
}

/// Takes samples out that no noise explains; returns how many.
pub(super) fn drop_outliers<F: AdjustableFrame>(
    capture: &mut Capture<F>,
    residuals: &[(f64, f64)],
    noise: &NoiseModel,
) -> usize {
    let mut rest = residuals.iter();
    let mut dropped = 0;
    for frame in &mut capture.frames {
        frame.retain_samples(|_| {
            let keep = rest.next().is_none_or(|(rho, r)| r.abs() <= OUTLIER * noise.depth.sigma(*rho));
            dropped += usize::from(!keep);
            keep
        });
    }
    dropped
}
