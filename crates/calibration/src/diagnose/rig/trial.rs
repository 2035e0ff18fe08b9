//! Effects of depth without images, tried in the joint adjustment.
//!
//! Pinhole, lens and place of such a camera come from its depth alone, so that they take up what its depth model lacks. While
//! they are held, as in the loop of one camera, an effect explains only what they left of it; here they are fitted jointly with
//! it.

use crate::diagnose::Thresholds;
use depthcal_io::RigLeftOut;
use depthcal_model::{PieceSpec, Register};
use tracing::{debug, info};

use super::joint_search::{JointEvidence, joint_search};
use super::left_out::left_out;
use crate::adjust::state::State;
use crate::calibrate::{self, CalibrateOptions, Calibrated, CalibratedCamera, EffectOf};
use crate::diagnose::DiagnoseError;
use crate::observe::Capture;

/// p-value, corrected for the numbers of effects and of their variants, below which an effect is tried.
const SIGNIFICANT: f64 = 1e-3;
/// Most effects that are tried.
const MOST_TRIED: usize = 4;
/// Most searches of an effect's constant with the rig that has it.
const REFINEMENTS: usize = 2;
/// Inverse depth at which the noise of fits is compared, 1/mm.
const TYPICAL_INVERSE_DEPTH: f64 = 1e-3;

/// An effect that the joint adjustment of the rig shows.
#[derive(Debug, Clone, PartialEq)]
pub struct EffectInRig {
    /// The effect, as for `calibrate --with`.
    pub spec: PieceSpec,
    /// Errors on left-out frames without it and with it.
    pub left_out: RigLeftOut,
}

/// The fit that effects are tried against.
pub(super) struct Tried<'a> {
    /// The rig without them.
    pub rig: &'a Calibrated,
    /// Options with which it was fitted.
    pub options: &'a CalibrateOptions,
    /// The effects that are considered: those of one camera without images.
    pub register: &'a Register,
    /// Parts into which frames are left out.
    pub folds: usize,
    /// Thresholds of the loop of one camera.
    pub thresholds: &'a Thresholds,
}

/// Of the effects whose joint score tests are significant, the one with which the rig predicts left-out frames of the camera
/// best, where that is certainly better than without; with the rig that has it.
///
/// # Errors
///
/// [`DiagnoseError`] of an adjustment. An effect with which the rig cannot be calibrated is passed over.
pub(super) fn tried_in_rig(
    capture: &Capture,
    camera: &str,
    tried: &Tried<'_>,
) -> Result<Option<(EffectInRig, Calibrated)>, DiagnoseError> {
    let Tried { rig, register, folds, thresholds, .. } = *tried;
    let (Some(number), Some(camera_fit)) =
        (rig.state.cameras.iter().position(|c| c.name == camera), rig.camera(camera))
    else {
        return Ok(None);
    };
    let ranked = joint_search(&rig.state, number, &camera_fit.calibrated, register, thresholds)?;
    let is_tried = |e: &&JointEvidence| e.p_value < SIGNIFICANT && e.gain_t >= thresholds.least_gain_t;
    let mut best: Option<(EffectInRig, Calibrated)> = None;
    for evidence in ranked.iter().filter(is_tried).take(MOST_TRIED) {
        let JointEvidence { spec, statistic, p_value, gain_t } = evidence;
        debug!("{camera}: {spec} has a score of {statistic:.1}, p = {p_value:.1e}, gains of t = {gain_t:.1}");
        let Some((spec, mut fit)) = refined(capture, (camera, number), tried, spec)? else { continue };
        // Errors of both are in the same noise.
        let noises: Vec<_> = fit.state.cameras.iter().map(|c| c.noise).collect();
        for (own, from) in fit.state.cameras.iter_mut().zip(&rig.state.cameras) {
            own.noise = from.noise;
        }
        let errors = left_out([&rig.state, &fit.state], number, folds)?;
        for (own, noise) in fit.state.cameras.iter_mut().zip(noises) {
            own.noise = noise;
        }
        debug!("{camera}: {spec} on left-out frames: {errors:?}");
        let Some(left_out) = errors.filter(|errors| errors.gain_percent.is_certain()) else { continue };
        info!("{camera}: {spec} lowers the error on left-out frames by {:.1} %", left_out.gain_percent.value);
        if best.as_ref().is_none_or(|(b, _)| left_out.after < b.left_out.after) {
            best = Some((EffectInRig { spec, left_out }, fit));
        }
    }
    Ok(best)
}

/// The rig with an effect whose constant, place and form are those that explain most once the rig has it: while it lacked it,
/// pinhole and place had taken up a part. `None` where the rig cannot be calibrated with it.
fn refined(
    capture: &Capture,
    (camera, number): (&str, usize),
    tried: &Tried<'_>,
    spec: &PieceSpec,
) -> Result<Option<(PieceSpec, Calibrated)>, DiagnoseError> {
    let fitted = |spec: &PieceSpec| {
        let mut with = tried.options.clone();
        with.effects.push(EffectOf { camera: Some(camera.to_owned()), effect: spec.clone() });
        let fit = calibrate::fit(capture, &with);
        fit.inspect_err(|error| info!("{camera}: the rig cannot be calibrated with {spec}: {error}")).ok()
    };
    // What a model lacks counts as noise.
    let noise = |fit: &Calibrated| fit.cameras[number].calibrated.noise.depth.sigma(TYPICAL_INVERSE_DEPTH);
    let Some(mut fit) = fitted(spec) else { return Ok(None) };
    let mut spec = spec.clone();
    let others: Vec<&str> = tried.register.names().filter(|name| *name != spec.name).collect();
    let register = others.into_iter().fold(tried.register.clone(), |register, name| register.without(name));
    for _ in 0..REFINEMENTS {
        let (state, without) = without_effect(&fit, number, &spec.name);
        let variants = joint_search(&state, number, &without, &register, tried.thresholds)?;
        let Some(best) = variants.into_iter().next().filter(|best| best.spec != spec) else { break };
        let Some(again) = fitted(&best.spec).filter(|again| noise(again) < noise(&fit)) else { break };
        debug!("{camera}: {spec} becomes {}", best.spec);
        (spec, fit) = (best.spec, again);
    }
    Ok(Some((spec, fit)))
}

/// A fitted rig whose camera lacks an effect of depth, all else as fitted, and this camera.
fn without_effect(fit: &Calibrated, number: usize, effect: &str) -> (State, CalibratedCamera) {
    let mut state = fit.state.clone();
    let camera = &mut state.cameras[number];
    if let Some(place) = camera.camera.blocks().iter().position(|block| block.name() == effect) {
        // Priors name blocks by their numbers.
        camera.priors.iter_mut().filter(|prior| prior.block > place).for_each(|prior| prior.block -= 1);
    }
    camera.camera = camera.camera.filtered(|block| block.name() != effect);
    let calibrated = CalibratedCamera { camera: camera.camera.clone(), ..fit.cameras[number].calibrated.clone() };
    (state, calibrated)
}
