//! The effects that were added, with what each brought.

use std::ops::Range;

use depthcal_io::{DiagnosisParameter, DiagnosisPlace, GainInterval, HeldOutErrors, Interval};
use depthcal_model::{Block, PieceSpec, Placement};

use super::added_effect::AddedEffect;
use super::effect_size::EffectSizes;
use super::error::DiagnoseError;
use super::free_map::FREE_MAP;
use super::held_out::HeldOut;
use super::observed_states::ObservedStates;
use crate::calibrate::CalibratedCamera;
use crate::judge::cross_validation::depth_gain_percent;
use crate::judge::intervals::depth_rms;

/// An effect that was added.
#[derive(Debug, Clone)]
pub struct Step {
    /// Names of the effects that explained the residuals together, the added one first.
    pub effects: Vec<String>,
    /// The added effect, as for `calibrate --with`.
    pub spec: PieceSpec,
    /// Effects that these captures cannot distinguish from it.
    pub indistinguishable: Vec<String>,
    /// Effects that only cameras of another technology have, and that explain a part of the same.
    pub of_other_technologies: Vec<String>,
    /// Where and how it acts, for an effect of depth.
    pub place: Option<DiagnosisPlace>,
    /// Its other places and forms that these captures cannot distinguish from the one it has.
    pub places_not_told_apart: Vec<DiagnosisPlace>,
    /// Its fitted parameters; none of a free map.
    pub parameters: Vec<DiagnosisParameter>,
    /// Root mean square over the observations of what other parameters of the model cannot take up of it, mm.
    pub size_mm: f64,
    /// p-value, corrected for the number of effects tested.
    pub p_value: f64,
    /// Held-out errors before it was added.
    pub before: HeldOutErrors,
    /// Held-out errors with it.
    pub after: HeldOutErrors,
    /// Held-out depth error with it, with a 95 % interval over frames.
    pub depth_rms_after_mm: Option<Interval>,
    /// Fall of the held-out depth error from `before` to `after`, per cent, with a 95 % interval over frames.
    pub depth_gain_percent: Option<GainInterval>,
    /// Fall of the error on left-out frames through it, given all other effects of the last model, per cent: of depth weighted by
    /// its noise and of reprojection, the less certain one with frames left out singly and in blocks. `None` of a free map.
    pub gain_percent: Option<GainInterval>,
}

/// The effects that were added, with the parameters that the last model `fit` has; `declared` are the errors of the declared
/// model.
///
/// # Errors
///
/// [`DiagnoseError::NotFitted`] where the fit lacks one of them.
pub(super) fn steps(
    added: &[AddedEffect],
    declared: &HeldOut,
    fit: &CalibratedCamera,
) -> Result<Vec<Step>, DiagnoseError> {
    let states = ObservedStates::of(fit);
    let befores = std::iter::once(declared).chain(added.iter().map(|a| &a.after));
    let step = |(added, before): (&AddedEffect, &HeldOut)| {
        let name = &added.evidence.name;
        // The free map's parameters name no cause, and D takes up a part of its values: its size is that without this part.
        let (parameters, size_mm) = if name == FREE_MAP {
            (Vec::new(), added.evidence.expected_size_mm)
        } else {
            let (range, block) =
                fitted_block(fit, name).ok_or_else(|| DiagnoseError::NotFitted { effect: name.clone() })?;
            (fitted_parameters(fit, range, block), EffectSizes::new(&states, Some(name)).rms_mm(block))
        };
        Ok(Step {
            effects: added.effects.clone(),
            spec: added.evidence.spec.clone(),
            indistinguishable: added.indistinguishable.clone(),
            of_other_technologies: added.of_other_technologies.clone(),
            place: place(&added.evidence.block, added.evidence.spec.placement),
            places_not_told_apart: not_told_apart(added),
            parameters,
            size_mm,
            p_value: added.p_value,
            before: before.errors,
            after: added.after.errors,
            depth_rms_after_mm: depth_rms(added.after.evaluated.frames.iter())
                .and_then(|change| change.after_interval()),
            gain_percent: added.gain_percent,
            depth_gain_percent: depth_gain_percent(&before.evaluated, &added.after.evaluated),
        })
    };
    added.iter().zip(befores).map(step).collect()
}

/// Place and form in which a piece acts on depth; `None` for pieces that have none.
fn place(block: &Block, placement: Placement) -> Option<DiagnosisPlace> {
    let piece = block.piece().filter(|piece| piece.can_be_placed())?;
    Some(DiagnosisPlace { of: placement.of, on: placement.on.unwrap_or(piece.form()) })
}

fn not_told_apart(added: &AddedEffect) -> Vec<DiagnosisPlace> {
    added.placements_not_told_apart.iter().filter_map(|other| place(&added.evidence.block, *other)).collect()
}

/// The block of a name and the range of its parameters among those of the camera.
fn fitted_block<'a>(fit: &'a CalibratedCamera, name: &str) -> Option<(Range<usize>, &'a Block)> {
    fit.camera.blocks_with_ranges().find(|(block, _)| block.name() == name).map(|(block, range)| (range, block))
}

/// The parameters of a block with their standard deviations; `range` is their place among those of the camera.
fn fitted_parameters(fit: &CalibratedCamera, range: Range<usize>, block: &Block) -> Vec<DiagnosisParameter> {
    let stds = fit.std_devs();
    let each = block.parameters().iter().zip(&block.theta).zip(&stds[range]);
    each.map(|((p, value), std)| DiagnosisParameter {
        name: p.name.to_string(),
        value: *value,
        unit: p.unit.to_string(),
        std: *std,
    })
    .collect()
}
