//! Whether an effect of the lens shows in the images alone.
//!
//! In the joint adjustment an unknown error of depth pulls at the poses, and a piece of the lens that turns the rays with them lowers the
//! cost though no image calls for it. So where something is unexplained, the markers have to show an effect of the lens by themselves. Where
//! nothing is, depth may be what shows it: K and the poses take up most of a tilted sensor in the image.

use std::iter::once;

use depthcal_model::hook::HookKind;
use depthcal_model::{PieceSpec, Register};
use depthcal_solver::score::ScoreError;

use super::augmented_model::{AugmentedModel, Fitted};
use super::candidate_blocks::{CandidateBlock, linearize_images};
use super::error::DiagnoseError;
use super::evidence::{Evidence, difference};
use super::merit::significant;
use super::thresholds::Thresholds;
use crate::calibrate::Calibrated;

impl AugmentedModel<'_> {
    /// Removes the effects of the lens that were added and that images alone do not show, each given the others, and fits the model without
    /// them. Returns the specs of the removed ones.
    ///
    /// # Errors
    ///
    /// [`DiagnoseError`] where the model without them cannot be fitted or examined.
    pub(super) fn remove_hidden_lens_effects(&mut self, present: &mut Fitted) -> Result<Vec<PieceSpec>, DiagnoseError> {
        let (register, thresholds) = (&self.declared().register, self.thresholds());
        let mut hidden = Vec::new();
        let of_lens = self.added.iter().map(|added| &added.evidence).filter(|e| e.block.hook() == HookKind::Lens);
        for effect in of_lens {
            let camera = present.fit.camera.filtered(|block| block.name() != effect.name);
            let without = Calibrated { camera, ..present.fit.clone() };
            if !shows_in_images(&without, register, effect, &[], thresholds)? {
                hidden.push(effect.spec.clone());
            }
        }
        if !hidden.is_empty() {
            self.added.retain(|added| !hidden.contains(&added.evidence.spec));
            *present = self.fitted(&self.present())?;
            self.update_errors(0, &present.held_out)?;
        }
        Ok(hidden)
    }
}

/// Whether an effect is significant in the markers alone, given those of the `others` that act on the lens; true of effects at other hooks.
///
/// # Errors
///
/// [`ScoreError`] where the problem cannot be evaluated.
pub(super) fn shows_in_images(
    fit: &Calibrated,
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
