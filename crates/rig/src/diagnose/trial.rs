//! Effects of depth without images, tried in the joint adjustment.
//!
//! Pinhole, lens and place of such a camera come from its depth alone, so that they take up what its depth model lacks. While they are
//! held, as in the loop of one camera, an effect explains only what they left of it; here they are fitted jointly with it.

use depthcal_calibration::diagnose::Diagnosis;
use depthcal_calibration::diagnose::evidence::Evidence;
use depthcal_model::PieceSpec;
use tracing::info;

use super::left_out::{LeftOutErrors, left_out};
use crate::calibrate::{EffectOf, RigCalibrated, RigOptions, calibrate_rig};
use crate::capture::RigCapture;
use crate::error::RigError;

/// p-value, corrected for the number of effects, below which an effect is tried.
const SIGNIFICANT: f64 = 1e-3;
/// Most effects that are tried.
const MOST_TRIED: usize = 4;

/// An effect that the joint adjustment of the rig shows.
#[derive(Debug, Clone, PartialEq)]
pub struct EffectInRig {
    /// The effect, as for `calibrate --with`.
    pub spec: PieceSpec,
    /// Errors on left-out frames without it and with it.
    pub left_out: LeftOutErrors,
}

/// Of the effects that are significant in the first round of a camera's diagnosis, the one with which the rig predicts left-out frames of
/// the camera best, where that is certainly better than without; with the rig that has it. `rig` is the fit without.
///
/// # Errors
///
/// [`RigError`] of an adjustment. An effect with which the rig cannot be calibrated is passed over.
pub(super) fn tried_in_rig(
    capture: &RigCapture,
    camera: &str,
    diagnosis: &Diagnosis,
    (rig, options, folds): (&RigCalibrated, &RigOptions, usize),
) -> Result<Option<(EffectInRig, RigCalibrated)>, RigError> {
    let (Some(number), Some(round)) =
        (rig.state.cameras.iter().position(|c| c.name == camera), diagnosis.rounds.first())
    else {
        return Ok(None);
    };
    let tests = round.effects().count() as f64;
    let is_significant = |e: &&Evidence| e.p_value * tests < SIGNIFICANT;
    let mut best: Option<(EffectInRig, RigCalibrated)> = None;
    for evidence in round.effects().filter(is_significant).take(MOST_TRIED) {
        let mut with = options.clone();
        with.effects.push(EffectOf { camera: Some(camera.to_owned()), effect: evidence.spec.clone() });
        let mut fit = match calibrate_rig(capture, &with) {
            Ok(fit) => fit,
            Err(error) => {
                info!("{camera}: the rig cannot be calibrated with {}: {error}", evidence.spec);
                continue;
            }
        };
        // Errors of both are in the same noise.
        let noises: Vec<_> = fit.state.cameras.iter().map(|c| c.noise).collect();
        for (own, from) in fit.state.cameras.iter_mut().zip(&rig.state.cameras) {
            own.noise = from.noise;
        }
        let errors = left_out([&rig.state, &fit.state], number, folds)?;
        for (own, noise) in fit.state.cameras.iter_mut().zip(noises) {
            own.noise = noise;
        }
        let Some(left_out) = errors.filter(|errors| errors.gain_percent.is_certain()) else { continue };
        info!(
            "{camera}: {} lowers the error on left-out frames by {:.1} %",
            evidence.spec, left_out.gain_percent.value
        );
        if best.as_ref().is_none_or(|(b, _)| left_out.after < b.left_out.after) {
            best = Some((EffectInRig { spec: evidence.spec.clone(), left_out }, fit));
        }
    }
    Ok(best)
}
