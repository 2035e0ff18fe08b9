//! The driver: the rig's calibration, every camera's diagnosis, the rig again with what was added.

use depthcal_io::Verdict;
use depthcal_model::Register;
use depthcal_model::hook::HookKind;

use super::alone::examined;
use super::drift_test::{DriftTest, drift_tests};
use super::trial::{EffectInRig, Tried, tried_in_rig};
use crate::adjust::blocks::is_depth_only;
use crate::calibrate::{CalibrateError, CalibrateOptions, Calibrated, CameraOptions, EffectOf, check_evidence, fit};
use crate::diagnose::capture_diagnosis::{CameraInRig, DiagnosedCamera, Diagnosis, RigDiagnosis, worst};
use crate::diagnose::closed_loop::diagnose_camera;
use crate::diagnose::{DiagnoseError, DiagnoseOptions};
use crate::judge::evaluate::{evaluate, evaluate_fitted};
use crate::observe::{CameraCapture, Capture, PlaceDrift};

/// Most effects of a camera without images that are added by trials in the rig.
const MOST_IN_RIG: usize = 3;

/// Diagnoses several cameras: calibrates them with the declared models, runs the loop on each that has depth, and adjusts all
/// jointly again with the effects that were added. Errors before and after are those on `verify` where it is given, else on one
/// frame in so many as there are folds, which both fits leave out.
///
/// # Errors
///
/// [`DiagnoseError`] of the calibrations, also where the cameras still contradict each other with all effects,
/// [`DiagnoseError::Camera`] of a camera's loop.
pub fn diagnose_rig(
    capture: &Capture,
    verify: Option<&Capture>,
    options: &DiagnoseOptions,
) -> Result<Diagnosis, DiagnoseError> {
    let is_depth = |camera: &&CameraCapture| camera.capture.has_depth();
    // An effect that a camera lacks looks like planes of its frames: the search ignores these, and the last fit has them.
    let asked = options.calibrate.each.frame_planes;
    let options = &DiagnoseOptions { calibrate: with_frame_planes(&options.calibrate, false), ..options.clone() };
    let declared = fit(capture, &options.calibrate)?;
    let mut cameras = Vec::new();
    for camera in capture.cameras.iter().filter(is_depth) {
        let of_verify = verify.and_then(|v| v.cameras.iter().find(|c| c.name == camera.name));
        cameras.push(match camera.has_markers() {
            true => examine(camera, of_verify, &declared, options)?,
            false => in_rig(capture, camera, &declared, options)?,
        });
    }
    let mut with_effects = with_effects_of(&cameras, &options.calibrate)?;
    let usable = without_bad_frames(capture, &cameras);
    let names = usable.frame_names();
    let is_held = |name: &str| {
        let place = names.iter().position(|n| n == name);
        place.is_some_and(|i| i % options.folds == options.folds - 1)
    };
    let (fitted, held) = match verify {
        Some(verify) => (usable.clone(), verify.clone()),
        None => (usable.subset(|name| !is_held(name)), usable.subset(is_held)),
    };
    let errors = |model: &CalibrateOptions| Ok::<_, DiagnoseError>(evaluate(&fit(&fitted, model)?.placed(), &held));
    let mut last = fit(&usable, &with_frame_planes(&with_effects, asked))?;
    let drifts = drift_tests(&last, options.folds)?;
    with_effects.drifts.extend(certain_drifts(capture, &drifts));
    if !with_effects.drifts.is_empty() {
        last = fit(&usable, &with_frame_planes(&with_effects, asked))?;
    }
    check_evidence(&last)?;
    let (before, after) = (errors(&options.calibrate)?, errors(&with_effects)?);
    let of_drifts = with_effects.drifts.first().map(|_| Verdict::Effect);
    let without_depth = capture.cameras.iter().filter(|c| !is_depth(c)).map(|c| c.name.clone()).collect();
    let rig = RigDiagnosis { without_depth, drifts, fitted: evaluate_fitted(&last), last, before, after };
    let verdict = worst(cameras.iter().map(DiagnosedCamera::verdict).chain(of_drifts));
    Ok(Diagnosis { verdict, cameras, rig: Some(rig) })
}

/// The model with the effects of every camera's diagnosis, and the registers that know them.
fn with_effects_of(
    cameras: &[DiagnosedCamera],
    declared: &CalibrateOptions,
) -> Result<CalibrateOptions, DiagnoseError> {
    let mut with_effects = declared.clone();
    for camera in cameras {
        for effect in camera.in_rig.iter().flat_map(|in_rig| &in_rig.effects) {
            let block = camera.register.make(effect, None);
            let block = block.map_err(|e| CalibrateError::of_camera(&camera.name)(e.into()))?;
            // There is one board, which all cameras see.
            let only_camera = (block.hook() != HookKind::Board).then(|| camera.name.clone());
            let is_known = |known: &EffectOf| {
                known.effect.name == effect.name && (known.camera.is_none() || known.camera == only_camera)
            };
            if !with_effects.effects.iter().any(is_known) {
                with_effects.effects.push(EffectOf { camera: only_camera, effect: effect.clone() });
            }
        }
        with_effects.registers.insert(camera.name.clone(), camera.register.clone());
    }
    Ok(with_effects)
}

/// The drifts that are certain: of time and temperature, which often go together, the one that leaves less.
fn certain_drifts(capture: &Capture, drifts: &[DriftTest]) -> Vec<(String, PlaceDrift)> {
    let left = |test: &&DriftTest| test.left_out.map_or(f64::INFINITY, |errors| errors.after);
    let best = |camera: &CameraCapture| {
        let certain = drifts.iter().filter(|test| test.certain && test.camera == camera.name);
        let test = certain.min_by(|a, b| left(a).total_cmp(&left(b)))?;
        Some((camera.name.clone(), test.drift))
    };
    capture.cameras.iter().filter_map(best).collect()
}

/// Options of a rig whose frames may have planes of their own, or not.
fn with_frame_planes(model: &CalibrateOptions, frame_planes: bool) -> CalibrateOptions {
    CalibrateOptions { each: CameraOptions { frame_planes, ..model.each.clone() }, ..model.clone() }
}

/// Effects of a camera without images that the joint adjustment shows, one after the other; then the loop given these.
fn in_rig(
    capture: &Capture,
    camera: &CameraCapture,
    declared: &Calibrated,
    options: &DiagnoseOptions,
) -> Result<DiagnosedCamera, DiagnoseError> {
    let mut options = options.clone();
    let mut present = declared.clone();
    let mut before: Vec<EffectInRig> = Vec::new();
    let register = of_depth_alone(&options.calibrate.of(camera)?);
    while before.len() < MOST_IN_RIG {
        let (model, folds, thresholds) = (&options.calibrate, options.folds, &options.thresholds);
        let tried = Tried { rig: &present, options: model, register: &register, folds, thresholds };
        let Some((effect, fit)) = tried_in_rig(capture, &camera.name, &tried)? else { break };
        options.calibrate.effects.push(EffectOf { camera: Some(camera.name.clone()), effect: effect.spec.clone() });
        before.push(effect);
        present = fit;
    }
    let mut diagnosed = examine(camera, None, &present, &options)?;
    if let Some(in_rig) = &mut diagnosed.in_rig {
        in_rig.effects.splice(0..0, before.iter().map(|effect| effect.spec.clone()));
        in_rig.before = before;
    }
    Ok(diagnosed)
}

/// The loop on one camera.
fn examine(
    camera: &CameraCapture,
    verify: Option<&CameraCapture>,
    rig: &Calibrated,
    options: &DiagnoseOptions,
) -> Result<DiagnosedCamera, DiagnoseError> {
    let poses_from_others = !camera.has_markers();
    let (capture, calibrate) = examined(camera, rig, &options.calibrate)?
        .ok_or_else(|| DiagnoseError::LacksCamera { camera: camera.name.clone() })?;
    let declared_register = calibrate.register.clone();
    let register = match poses_from_others {
        // Projected markers are exact: of effects that images show they say nothing.
        true => of_depth_alone(&calibrate),
        false => declared_register.clone(),
    };
    // In another dataset a camera without images has no poses of its own; its frames are cross-validated.
    let verify = verify.filter(|_| !poses_from_others).map(|v| &v.capture);
    let diagnosis = diagnose_camera(&capture, verify, &options.of(CameraOptions { register, ..calibrate }))
        .map_err(|source| DiagnoseError::Camera { camera: camera.name.clone(), source: Box::new(source) })?;
    let effects = diagnosis.steps.iter().map(|step| step.spec.clone()).collect();
    let register = diagnosis.register(&declared_register)?;
    let in_rig = Some(CameraInRig { poses_from_others, before: Vec::new(), effects });
    Ok(DiagnosedCamera { name: camera.name.clone(), diagnosis, register, in_rig })
}

/// The register without effects of board, lens and pixels that are not declared.
fn of_depth_alone(calibrate: &CameraOptions) -> Register {
    let whole = &calibrate.register;
    let is_declared = |name: &str| calibrate.effects.iter().any(|effect| effect.name == name);
    let shows_in_images = |name: &&str| whole.block(name, None).is_ok_and(|block| !is_depth_only(&block));
    let others: Vec<&str> = whole.names().filter(|name| shows_in_images(name) && !is_declared(name)).collect();
    others.into_iter().fold(whole.clone(), |register, name| register.without(name))
}

/// The capture without the frames that the diagnosis of a camera left out: of that camera alone.
fn without_bad_frames(capture: &Capture, diagnoses: &[DiagnosedCamera]) -> Capture {
    let mut usable = capture.clone();
    for (camera, found) in
        usable.cameras.iter_mut().filter_map(|c| diagnoses.iter().find(|d| d.name == c.name).map(|d| (c, d)))
    {
        let is_bad = |name: &str| found.diagnosis.bad_frames.iter().any(|bad| bad.name == name);
        camera.capture = camera.capture.subset(|_, frame| !is_bad(&frame.name));
    }
    usable
}
