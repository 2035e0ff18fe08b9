//! Errors of a model on frames that it was not fitted to, and whether one model is better there than another.

use std::sync::Arc;

use depthcal_io::{GainInterval, HeldOutErrors};
use tracing::debug;

use super::thresholds::Thresholds;
use crate::judge::camera::EvaluatedCamera;
use crate::judge::cross_validation::{
    depth_gain_percent, dot_gain_percent, weighted_gain_of_blocks_percent, weighted_gain_percent,
};
use crate::observe::noise::DepthNoise;

/// Errors of a model on frames that it was not fitted to. Copies share them.
#[derive(Debug, Clone)]
pub struct HeldOut {
    /// One number per kind of error.
    pub errors: HeldOutErrors,
    /// Errors frame by frame, each frame left out together with others from all over the capture.
    pub evaluated: Arc<EvaluatedCamera>,
    /// Errors with blocks of consecutive frames left out; `None` where another dataset verifies, and of models with fields.
    pub blocks: Option<Arc<EvaluatedCamera>>,
}

impl HeldOut {
    /// A copy without single pixels, for a model that is no longer compared with others.
    pub(super) fn without_pixels(&self) -> Self {
        Self { errors: self.errors, evaluated: self.evaluated.without_pixels().into(), blocks: None }
    }
}

/// The gain of a change of the model on held-out frames.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Gain {
    /// The error falls for certain. The fall is the less certain one of those with frames left out singly and in blocks, of the
    /// weighted errors or of the unweighted depth error where that falls for certain.
    Certain(GainInterval),
    /// It falls, but this may be chance; or an error that users read rises. The fall is the less certain one of those with frames
    /// left out singly and in blocks.
    Possible(GainInterval),
    /// It does not fall.
    None,
}

/// The gain of the model `after` over the model `before`.
///
/// Counted is the change of the product of the depth error weighted by `noise` and of the reprojection error: a loss in one
/// cancels a gain in the other. The gain is certain where its 95 % interval over frames excludes zero, or that of the fall of
/// the unweighted depth error, with frames left out singly and in blocks: neighbours of a sweep are alike. No error that users
/// read, unweighted depth and dot error, may rise beyond its interval. A rise of the unweighted depth error, which far pixels
/// dominate, that is larger than the weighted gain makes the gain uncertain.
///
/// Of an effect of time (`of_time`) a block of consecutive frames is an extrapolation: there the error must not rise, but need
/// not fall for certain. Instead the fall with frames left out singly must be certain over blocks of frames, not only over
/// frames: it must not come from one stretch of the recording.
pub(super) fn gain(
    before: &HeldOut,
    after: &HeldOut,
    noise: &DepthNoise,
    of_time: bool,
    thresholds: &Thresholds,
) -> Gain {
    let weighted = |b: &EvaluatedCamera, a: &EvaluatedCamera| weighted_gain_percent(b, a, noise);
    let singly = weighted(&before.evaluated, &after.evaluated);
    let blocks = before.blocks.as_ref().zip(after.blocks.as_ref());
    let in_blocks = blocks.and_then(|(b, a)| weighted(b, a));
    let falls_in_blocks = in_blocks.is_none_or(|g| g.value > 0.0);
    let over_blocks =
        of_time.then(|| weighted_gain_of_blocks_percent(&before.evaluated, &after.evaluated, noise)).flatten();
    let gains = || singly.iter().chain(if of_time { over_blocks.iter() } else { in_blocks.iter() });
    let Some(least) = gains().min_by(|a, b| a.low.total_cmp(&b.low)) else { return Gain::None };
    if !(falls_in_blocks && gains().all(|g| g.value > thresholds.least_held_out_gain_percent)) {
        return Gain::None;
    }
    let depth = depth_gain_percent(&before.evaluated, &after.evaluated);
    let dots = dot_gain_percent(&before.evaluated, &after.evaluated);
    let rises = [depth, dots].into_iter().flatten().any(|g| g.high < 0.0);
    let loses = depth.zip(singly).is_some_and(|(unweighted, weighted)| {
        unweighted.value < -thresholds.most_unweighted_loss_percent && -unweighted.value > weighted.value
    });
    let certain_of = |gains: [Option<GainInterval>; 2]| gains.into_iter().flatten().find(GainInterval::is_certain);
    let of_frames = certain_of([singly, depth]);
    let of_blocks = match (of_time, blocks) {
        (true, _) => certain_of([over_blocks, None]),
        (false, None) => of_frames,
        (false, Some((b, a))) => certain_of([in_blocks, depth_gain_percent(b, a)]),
    };
    let certain =
        of_frames.zip(of_blocks).map(|(frames, blocks)| if blocks.low < frames.low { blocks } else { frames });
    debug!(?singly, ?depth, ?dots, ?in_blocks, ?over_blocks, ?certain, rises, loses, "gain on held-out frames");
    match certain {
        Some(gain) if !rises && !loses => Gain::Certain(gain),
        _ => Gain::Possible(*least),
    }
}
