//! The driver: the rig's calibration, every camera's diagnosis, the rig again with what was added.

use depthcal_io::Verdict;
use depthcal_model::hook::HookKind;
use depthcal_model::{PieceSpec, Register};
use tracing::{info, warn};

use super::alone::examined;
use super::drift_test::{DriftTest, drift_tests};
use super::trial::{EffectInRig, Tried, tried_in_rig};
use crate::adjust::blocks::is_depth_only;
use crate::calibrate::{CalibrateOptions, Calibrated, CameraOptions, EffectOf, check_evidence, fit};
use crate::diagnose::capture_diagnosis::{CameraInRig, DiagnosedCamera, Diagnosis, RigDiagnosis, worst};
use crate::diagnose::closed_loop::diagnose_camera;
use crate::diagnose::{DiagnoseError, DiagnoseOptions};
use crate::judge::evaluate::{evaluate, evaluate_fitted, placed_by_others};
use crate::observe::{CameraCapture, CameraFrames, Capture, PlaceDrift};

/// Most examinations of a camera with images: the second is given what others show of the board.
const PASSES: usize = 2;
/// Most effects of a camera without images that are added by trials in the rig.
const MOST_IN_RIG: usize = 3;

/// Diagnoses several cameras: runs the loop on each that has images and depth, calibrates all jointly with what these show of the
/// board, runs the loop on those without images given the others' poses, and adjusts all again with the effects that were added.
/// Errors before and after are those on `verify` where it is given, else on one frame in so many as there are folds, which both
/// fits leave out.
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
    // An effect that a camera lacks looks like planes of its frames: the search ignores these, and the last fit has them.
    let asked = options.calibrate.each.frame_planes;
    let options = &DiagnoseOptions { calibrate: with_frame_planes(&options.calibrate, false), ..options.clone() };
    let (mut cameras, of_board) = with_images(capture, verify, options)?;
    let mut given_board = options.clone();
    let of_board: Vec<PieceSpec> = of_board.into_iter().map(|shown| shown.effect).collect();
    let of_all = of_board.iter().map(|effect| EffectOf { camera: None, effect: effect.clone() });
    given_board.calibrate.effects.extend(of_all);
    if let Some(depth_only) = capture.cameras.iter().find(lacks_images) {
        info!("{}: the others are adjusted jointly, to place the board in it", depth_only.name);
        let rig = fit(capture, &given_board.calibrate)?;
        for camera in capture.cameras.iter().filter(lacks_images) {
            cameras.push(with_board(in_rig((capture, verify), camera, &rig, &given_board)?, of_board.clone()));
        }
        cameras.sort_by_key(|diagnosed| capture.cameras.iter().position(|camera| camera.name == diagnosed.name));
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
    let before = errors(&options.calibrate).or_else(|error| {
        warn!("the declared models cannot be adjusted jointly ({error}): errors before are those with what cameras show of the board");
        errors(&given_board.calibrate)
    })?;
    let after = errors(&with_effects)?;
    let of_drifts = with_effects.drifts.first().map(|_| Verdict::Effect);
    let without_depth = capture.cameras.iter().filter(|c| !c.capture.has_depth()).map(|c| c.name.clone()).collect();
    let rig = RigDiagnosis { without_depth, drifts, fitted: evaluate_fitted(&last), last, before, after };
    let verdict = worst(cameras.iter().map(DiagnosedCamera::verdict).chain(of_drifts));
    Ok(Diagnosis { verdict, cameras, rig: Some(rig) })
}

/// An effect of the board that the loop of a camera shows.
struct ShownByCamera {
    camera: String,
    effect: PieceSpec,
}

/// The loops of the cameras with images and depth, and what they show of the board. There is one board: what one of them shows,
/// the others are given, and those that were examined without it are examined again.
fn with_images(
    capture: &Capture,
    verify: Option<&Capture>,
    options: &DiagnoseOptions,
) -> Result<(Vec<DiagnosedCamera>, Vec<ShownByCamera>), DiagnoseError> {
    let mut diagnosed: Vec<DiagnosedCamera> = Vec::new();
    let mut of_board: Vec<ShownByCamera> = Vec::new();
    for _ in 0..PASSES {
        for camera in capture.cameras.iter().filter(|camera| camera.capture.has_depth() && camera.has_markers()) {
            let by_others = of_board.iter().filter(|shown| shown.camera != camera.name);
            let given: Vec<PieceSpec> = by_others.map(|shown| shown.effect.clone()).collect();
            let earlier = diagnosed.iter().position(|other| other.name == camera.name);
            let knows = |effect: &PieceSpec| {
                earlier.is_some_and(|i| diagnosed[i].effects().iter().any(|known| known.name == effect.name))
            };
            if earlier.is_some() && given.iter().all(knows) {
                continue;
            }
            let of_verify = verify.and_then(|v| v.cameras.iter().find(|c| c.name == camera.name));
            let examined = examine_alone(camera, of_verify, &given, options)?;
            of_board.retain(|shown| shown.camera != camera.name);
            for step in &examined.diagnosis.steps {
                if is_of_board(&examined.register, &step.spec) {
                    of_board.push(ShownByCamera { camera: camera.name.clone(), effect: step.spec.clone() });
                }
            }
            match earlier {
                Some(i) => diagnosed[i] = examined,
                None => diagnosed.push(examined),
            }
        }
    }
    Ok((diagnosed, of_board))
}

fn lacks_images(camera: &&CameraCapture) -> bool {
    camera.capture.has_depth() && !camera.has_markers()
}

/// Whether an effect acts on the board, which all cameras see.
fn is_of_board(register: &Register, effect: &PieceSpec) -> bool {
    register.make(effect, None).is_ok_and(|block| block.hook() == HookKind::Board)
}

/// The model with the effects of every camera's diagnosis, and the registers that know them.
fn with_effects_of(
    cameras: &[DiagnosedCamera],
    declared: &CalibrateOptions,
) -> Result<CalibrateOptions, DiagnoseError> {
    let mut with_effects = declared.clone();
    for camera in cameras {
        for effect in camera.in_rig.iter().flat_map(|in_rig| &in_rig.effects) {
            // There is one board, which all cameras see.
            let only_camera = (!is_of_board(&camera.register, effect)).then(|| camera.name.clone());
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
    (capture, verify): (&Capture, Option<&Capture>),
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
    let mut diagnosed = examine_in_rig(camera, verify, &present, &options)?;
    if let Some(in_rig) = &mut diagnosed.in_rig {
        in_rig.effects.splice(0..0, before.iter().map(|effect| effect.spec.clone()));
        in_rig.before = before;
    }
    Ok(diagnosed)
}

/// The loop on a camera with images, by these alone, given effects of the board.
fn examine_alone(
    camera: &CameraCapture,
    verify: Option<&CameraCapture>,
    of_board: &[PieceSpec],
    options: &DiagnoseOptions,
) -> Result<DiagnosedCamera, DiagnoseError> {
    let mut calibrate = options.calibrate.of(camera)?;
    let is_new = |effect: &&PieceSpec| calibrate.effects.iter().all(|known| known.name != effect.name);
    let given: Vec<PieceSpec> = of_board.iter().filter(is_new).cloned().collect();
    calibrate.effects.extend(given.iter().cloned());
    let register = calibrate.register.clone();
    let verify = verify.map(|v| &v.capture);
    let diagnosed = looped(&camera.name, &camera.capture, verify, calibrate, (&register, options))?;
    Ok(with_board(diagnosed, given))
}

/// The diagnosis of a camera whose loop was given effects of the board that others show.
fn with_board(mut diagnosed: DiagnosedCamera, given: Vec<PieceSpec>) -> DiagnosedCamera {
    if let Some(in_rig) = &mut diagnosed.in_rig {
        in_rig.effects.splice(0..0, given.iter().cloned());
        in_rig.of_board = given;
    }
    diagnosed
}

/// The loop on a camera without images, whose board is where the rig has it.
fn examine_in_rig(
    camera: &CameraCapture,
    verify: Option<&Capture>,
    rig: &Calibrated,
    options: &DiagnoseOptions,
) -> Result<DiagnosedCamera, DiagnoseError> {
    let (frames, calibrate) = examined(camera, rig, &options.calibrate)?
        .ok_or_else(|| DiagnoseError::LacksCamera { camera: camera.name.clone() })?;
    // Projected markers are exact: of effects that images show they say nothing.
    let (of_depth, register) = (of_depth_alone(&calibrate), calibrate.register.clone());
    let calibrate = CameraOptions { register: of_depth, ..calibrate };
    let verify = verify.and_then(|verify| placed_by_others(&rig.placed(), verify, &camera.name));
    let mut diagnosed = looped(&camera.name, &frames, verify.as_ref(), calibrate, (&register, options))?;
    if let Some(in_rig) = &mut diagnosed.in_rig {
        in_rig.poses_from_others = true;
    }
    Ok(diagnosed)
}

/// The loop on frames of a camera, whose pieces `register` has.
fn looped(
    name: &str,
    frames: &CameraFrames,
    verify: Option<&CameraFrames>,
    calibrate: CameraOptions,
    (register, options): (&Register, &DiagnoseOptions),
) -> Result<DiagnosedCamera, DiagnoseError> {
    let diagnosis = diagnose_camera(frames, verify, &options.of(calibrate))
        .map_err(|source| DiagnoseError::Camera { camera: name.to_owned(), source: Box::new(source) })?;
    let effects = diagnosis.steps.iter().map(|step| step.spec.clone()).collect();
    let register = diagnosis.register(register)?;
    let in_rig = Some(CameraInRig { effects, ..CameraInRig::default() });
    Ok(DiagnosedCamera { name: name.to_owned(), diagnosis, register, in_rig })
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
