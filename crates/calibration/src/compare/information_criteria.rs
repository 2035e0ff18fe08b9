//! Effective number of parameters, AIC and BIC of a fit.

use crate::calibrate::{Calibrated, Estimator};

/// Number of free parameters of camera, lens and depth model; of fields only the effective number, tr(Σ N), which the data
/// rather than the smoothness prior determine.
pub(super) fn effective_parameters(fitted: &Calibrated) -> f64 {
    let fields = &fitted.smoothness.fields;
    let blocks = fitted.camera.blocks().iter().map(|block| {
        let free = block.free.iter().filter(|f| **f).count() as f64;
        let fields_of_block = fields.iter().filter(|f| f.piece == block.name());
        fields_of_block.fold(free, |count, f| count - f.nodes as f64 + f.effective.unwrap_or(f.nodes as f64))
    });
    blocks.sum()
}

/// AIC (Akaike 1974), −2 ln L + 2 k, and BIC (Schwarz 1978), −2 ln L + k ln n, of a joint adjustment with `effective`
/// parameters k, up to a constant common to all models; `None` for other estimators. Both assume independent residuals;
/// pixels of a frame are correlated, so both favour large models.
pub(super) fn criteria(fitted: &Calibrated, effective: f64) -> Option<[f64; 2]> {
    if fitted.estimator != Estimator::Joint || !fitted.with_depth {
        return None;
    }
    let depths = fitted.capture.frames.iter().flat_map(|f| f.samples.iter().map(|s| 1.0 / s.depth_mm));
    let (sum, n) = depths.fold((0.0, 0), |(s, n), rho| (s + fitted.noise.depth.sigma(rho).ln(), n + 1));
    let markers: usize = fitted.capture.frames.iter().map(|f| f.markers.len()).sum();
    let deviance = 2.0 * fitted.cost + 2.0 * sum + 4.0 * markers as f64 * fitted.noise.pixel_sigma.ln();
    let rows = (n + 2 * markers) as f64;
    Some([2.0 * effective, effective * rows.ln()].map(|penalty| deviance + penalty))
}
