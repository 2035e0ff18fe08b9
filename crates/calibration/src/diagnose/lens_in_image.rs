//! Whether an effect of the lens shows in the images alone.
//!
//! In the joint adjustment an unknown error of depth pulls at the poses, and a piece of the lens that turns the rays with them
//! lowers the cost though no image calls for it. So where something is unexplained, the markers have to show an effect of the
//! lens by themselves. Where nothing is, depth may be what shows it: K and the poses take up most of a tilted sensor in the
//! image.

use std::iter::once;

use depthcal_model::Register;
use depthcal_model::hook::HookKind;
use depthcal_solver::score::ScoreError;

use super::candidate_blocks::{CandidateBlock, linearize_images};
use super::evidence::{Evidence, difference};
use super::merit::significant;
use super::thresholds::Thresholds;
use crate::calibrate::CalibratedCamera;

/// Whether an effect is significant in the markers alone, given those of the `others` that act on the lens; true of effects at
/// other hooks.
///
/// # Errors
///
/// [`ScoreError`] where the problem cannot be evaluated.
pub(super) fn shows_in_images(
    fit: &CalibratedCamera,
    register: &Register,
    effect: &Evidence,
    others: &[&Evidence],
    thresholds: &Thresholds,
) -> Result<bool, ScoreError> {
    if effect.block.hook() != HookKind::Lens {
        return Ok(true);
    }
    let others = others.iter().copied().filter(|e| e.block.hook() == HookKind::Lens);
    let candidates: Vec<CandidateBlock> =
        others.chain(once(effect)).filter_map(|e| CandidateBlock::effect(register, e.spec.clone())).collect();
    let linearization = linearize_images(fit, &candidates)?;
    let last = candidates.len() - 1;
    let all: Vec<usize> = (0..=last).collect();
    let added = difference(&linearization.held_out_gain(&all), &linearization.held_out_gain(&all[..last]));
    Ok(significant(linearization.score_adjusted(last, &all[..last]).p_value, 1, &added, thresholds))
}
