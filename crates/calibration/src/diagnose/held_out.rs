//! Errors of a model on frames that it was not fitted to, and whether one model is better there than another.

use depthcal_io::HeldOutErrors;

use super::thresholds::Thresholds;
use crate::judge::cross_validation::{depth_gain_percent, weighted_depth_rms};
use crate::judge::evaluate::Evaluated;
use crate::observe::noise::DepthNoise;

/// Errors of a model on frames that it was not fitted to.
#[derive(Debug, Clone)]
pub struct HeldOut {
    /// One number per kind of error.
    pub errors: HeldOutErrors,
    /// Errors frame by frame.
    pub evaluated: Evaluated,
}

/// Whether the model `after` has smaller held-out errors than the model `before`.
///
/// Counted are the changes in per cent of the depth error weighted by `noise` and of the reprojection error, together: a loss
/// in one cancels a gain in the other. A gain in weighted depth, which near pixels dominate, must not come with a rise of the
/// unweighted depth error, which far pixels dominate, unless that rise may be chance over the frames and is smaller than the
/// gain.
pub(super) fn improves(before: &HeldOut, after: &HeldOut, noise: &DepthNoise, thresholds: &Thresholds) -> bool {
    let gain = |b: f64, a: f64| if b > 0.0 { 100.0 * (1.0 - a / b) } else { 0.0 };
    let weighted = |h: &HeldOut| weighted_depth_rms(&h.evaluated, noise);
    let depth = weighted(before).zip(weighted(after)).map_or(0.0, |(b, a)| gain(b, a));
    let image = gain(before.errors.reprojection_px, after.errors.reprojection_px);
    let loses = || {
        depth_gain_percent(&before.evaluated, &after.evaluated).is_some_and(|unweighted| {
            let by_chance = unweighted.high > 0.0 && depth > -unweighted.value;
            unweighted.value < -thresholds.most_unweighted_loss_percent && !by_chance
        })
    };
    depth + image > thresholds.least_held_out_gain_percent && !loses()
}
