//! Depth residuals in their own units, and the samples that no noise explains.

use crate::adjust::adjustment::AdjustedCamera;
use crate::adjust::state::CameraState;
use crate::observe::AdjustableFrame;
use crate::observe::noise::NoiseModel;

/// Depth samples beyond this many standard deviations are outliers.
const OUTLIER: f64 = 8.0;

/// The residual of a depth sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct DepthResidual {
    /// Predicted inverse depth, at which the noise law is taken, 1/mm.
    pub rho: f64,
    /// Predicted minus measured inverse depth, 1/mm.
    pub residual: f64,
    /// Measured minus predicted depth, mm.
    pub depth_mm: f64,
}

/// The residuals of a camera's depth samples, frame after frame.
pub(super) fn depth_residuals<F: AdjustableFrame>(
    camera: &CameraState<F>,
    adjusted: &AdjustedCamera,
) -> Vec<DepthResidual> {
    let samples = camera.capture.frames.iter().flat_map(|f| f.samples().iter());
    samples
        .zip(adjusted.inverse_depth_residuals())
        .map(|(sample, residual)| {
            let measured = 1.0 / sample.depth_mm;
            let rho = measured + residual;
            DepthResidual { rho, residual, depth_mm: 1.0 / measured - 1.0 / rho }
        })
        .collect()
}

/// Takes samples out that no noise explains; returns how many.
pub(super) fn drop_outliers<F: AdjustableFrame>(
    camera: &mut CameraState<F>,
    residuals: &[DepthResidual],
    noise: &NoiseModel,
) -> usize {
    let mut residuals = residuals.iter();
    let mut dropped = 0;
    for frame in &mut camera.capture.frames {
        frame.retain_samples(|_| {
            let is_noise = residuals.next().is_none_or(|r| r.residual.abs() <= OUTLIER * noise.depth.sigma(r.rho));
            dropped += usize::from(!is_noise);
            is_noise
        });
    }
    dropped
}
