//! The driver: the rig's calibration, every camera's diagnosis, the rig again with what was added.

use crate::adjust::blocks::is_depth_only;
use crate::calibrate::CalibrateOptions;
use crate::diagnose::{DiagnoseOptions, Diagnosis, Thresholds, diagnose};
use depthcal_io::Verdict;
use depthcal_model::hook::HookKind;
use depthcal_model::{PieceSpec, Register};
use tracing::info;

use super::alone::examined;
use super::drift_test::{DriftTest, drift_tests};
use super::trial::{EffectInRig, Tried, tried_in_rig};
use crate::calibrate::rig::{EffectOf, RigCalibrated, RigOptions, check_evidence, fit_rig};
use crate::diagnose::DiagnoseError;
use crate::judge::rig::{EvaluatedRig, evaluate_rig};
use crate::observe::{CameraCapture, RigCapture};

/// Most effects of a camera without images that are added by trials in the rig.
const MOST_IN_RIG: usize = 3;

/// Options of a rig's diagnosis.
#[derive(Debug, Clone)]
pub struct RigDiagnoseOptions {
    /// The declared models: those that are examined first.
    pub rig: RigOptions,
    /// Cross-validation folds of every camera's diagnosis; one frame in as many is held out of the rig's errors where no other
    /// dataset is given.
    pub folds: usize,
    /// Whether formulas are searched for what the effects of the register leave unexplained.
    pub formulas: bool,
    /// Thresholds of the rules.
    pub thresholds: Thresholds,
}

impl Default for RigDiagnoseOptions {
    fn default() -> Self {
        let DiagnoseOptions { folds, formulas, thresholds, .. } = DiagnoseOptions::default();
        Self { rig: RigOptions::default(), folds, formulas, thresholds }
    }
}

/// Diagnosis of one camera of a rig: the effects that its model lacks.
pub struct CameraDiagnosis {
    /// The camera.
    pub name: String,
    /// Whether the poses of its board come from the other cameras, because it has no images.
    pub poses_from_others: bool,
    /// The frames that were examined, with projected markers where it has no images.
    pub capture: crate::observe::Capture,
    /// The loop's result on these frames.
    pub diagnosis: Diagnosis,
    /// Of a camera without images, effects that the joint adjustment showed, in which its pinhole and place are free; `diagnosis`
    /// is given these.
    pub in_rig: Vec<EffectInRig>,
    /// The effects that the joint adjustment took over, as for `calibrate --with`.
    pub effects: Vec<PieceSpec>,
    /// Effects that it did not: free maps, which the adjustment of a rig has no smoothness for, and formulas whose names another
    /// camera's have.
    pub not_adjusted: Vec<PieceSpec>,
}

impl CameraDiagnosis {
    /// The verdict of the loop, and of what the joint adjustment showed before.
    pub fn verdict(&self) -> Verdict {
        worst(self.in_rig.first().map(|_| Verdict::Effect).into_iter().chain([self.diagnosis.verdict]))
    }
}

/// Diagnosis of a rig: the effects that the models of its cameras lack, and drifts of their extrinsics.
pub struct RigDiagnosis {
    /// The worst of the cameras' verdicts.
    pub verdict: Verdict,
    /// The cameras with depth.
    pub cameras: Vec<CameraDiagnosis>,
    /// Cameras that have no depth, and are not examined.
    pub without_depth: Vec<String>,
    /// Whether places change with time or temperature, given the effects that were added.
    pub drifts: Vec<DriftTest>,
    /// The rig with all effects, fitted to all frames but those that a diagnosis left out.
    pub last: RigCalibrated,
    /// Errors of the last rig on the frames that it was fitted to.
    pub fitted: EvaluatedRig,
    /// Errors of the declared models on frames that the rig was not fitted to.
    pub before: EvaluatedRig,
    /// Errors on these frames with the effects and drifts that were added.
    pub after: EvaluatedRig,
    /// The register with the formulas that were found.
    pub register: Register,
}

/// Diagnoses a rig: calibrates it with the declared models, runs the loop of one camera on each that has depth, and adjusts all
/// cameras jointly again with the effects that were added. The rig's errors before and after are those on `verify` where it is
/// given, else on one frame in so many as there are folds, which both fits leave out.
///
/// # Errors
///
/// [`DiagnoseError`] of the calibrations, also where the cameras still contradict each other with all effects,
/// [`DiagnoseError::Camera`] of a camera's loop, [`DiagnoseError::NoDepth`] where no camera has depth.
pub fn diagnose_rig(
    capture: &RigCapture,
    verify: Option<&RigCapture>,
    options: &RigDiagnoseOptions,
) -> Result<RigDiagnosis, DiagnoseError> {
    let is_depth = |camera: &&CameraCapture| camera.capture.has_depth();
    if !capture.cameras.iter().any(|camera| is_depth(&camera)) {
        return Err(DiagnoseError::NoDepth { dataset: capture.name.clone() });
    }
    // An effect that a camera lacks looks like planes of its frames: the search ignores these, and the last fit has them.
    let asked = options.rig.each.frame_planes;
    let options = &RigDiagnoseOptions { rig: with_frame_planes(&options.rig, false), ..options.clone() };
    let declared = fit_rig(capture, &options.rig)?;
    let mut cameras = Vec::new();
    for camera in capture.cameras.iter().filter(is_depth) {
        let of_verify = verify.and_then(|v| v.cameras.iter().find(|c| c.name == camera.name));
        cameras.push(match camera.has_markers() {
            true => examine(camera, of_verify, &declared, options)?,
            false => in_rig(capture, camera, &declared, options)?,
        });
    }
    let mut with_effects = options.rig.clone();
    register_formulas(&mut cameras, &mut with_effects.each.register);
    for camera in &cameras {
        for effect in &camera.effects {
            let block = with_effects.each.register.make(effect, None);
            let block = block.map_err(|e| crate::calibrate::CalibrateError::of_camera(&camera.name)(e.into()))?;
            // There is one board, which all cameras see.
            let only_camera = (block.hook() != HookKind::Board).then(|| camera.name.clone());
            let is_known = |known: &EffectOf| {
                known.effect.name == effect.name && (known.camera.is_none() || known.camera == only_camera)
            };
            if !with_effects.effects.iter().any(is_known) {
                with_effects.effects.push(EffectOf { camera: only_camera, effect: effect.clone() });
            }
        }
    }
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
    let errors = |rig: &RigOptions| Ok::<_, DiagnoseError>(evaluate_rig(&fit_rig(&fitted, rig)?.placed(), &held));
    let mut last = fit_rig(&usable, &with_frame_planes(&with_effects, asked))?;
    let drifts = drift_tests(&last, options.folds)?;
    for camera in capture.cameras.iter().map(|c| &c.name) {
        // Of time and temperature, which often go together, the one that leaves less.
        let certain = drifts.iter().filter(|test| test.certain && test.camera == *camera);
        let left = |test: &&DriftTest| test.left_out.map_or(f64::INFINITY, |errors| errors.after);
        if let Some(test) = certain.min_by(|a, b| left(a).total_cmp(&left(b))) {
            with_effects.drifts.push((camera.clone(), test.drift));
        }
    }
    if !with_effects.drifts.is_empty() {
        last = fit_rig(&usable, &with_frame_planes(&with_effects, asked))?;
    }
    check_evidence(&last)?;
    let (before, after) = (errors(&options.rig)?, errors(&with_effects)?);
    let of_drifts = with_effects.drifts.first().map(|_| Verdict::Effect);
    let without_depth = capture.cameras.iter().filter(|c| !is_depth(c)).map(|c| c.name.clone()).collect();
    Ok(RigDiagnosis {
        verdict: worst(cameras.iter().map(CameraDiagnosis::verdict).chain(of_drifts)),
        drifts,
        fitted: evaluate_rig(&last.placed(), &usable),
        cameras,
        without_depth,
        last,
        before,
        after,
        register: with_effects.each.register,
    })
}

/// Options of a rig whose frames may have planes of their own, or not.
fn with_frame_planes(rig: &RigOptions, frame_planes: bool) -> RigOptions {
    RigOptions { each: CalibrateOptions { frame_planes, ..rig.each.clone() }, ..rig.clone() }
}

/// Effects of a camera without images that the joint adjustment shows, one after the other; then the loop given these.
fn in_rig(
    capture: &RigCapture,
    camera: &CameraCapture,
    declared: &RigCalibrated,
    options: &RigDiagnoseOptions,
) -> Result<CameraDiagnosis, DiagnoseError> {
    let mut options = options.clone();
    let mut present = declared.clone();
    let mut shown: Vec<EffectInRig> = Vec::new();
    let register = of_depth_alone(&options.rig.of(camera)?);
    while shown.len() < MOST_IN_RIG {
        let (rig, folds, thresholds) = (&options.rig, options.folds, &options.thresholds);
        let tried = Tried { rig: &present, options: rig, register: &register, folds, thresholds };
        let Some((effect, fit)) = tried_in_rig(capture, &camera.name, &tried)? else { break };
        options.rig.effects.push(EffectOf { camera: Some(camera.name.clone()), effect: effect.spec.clone() });
        shown.push(effect);
        present = fit;
    }
    let mut diagnosis = examine(camera, None, &present, &options)?;
    let specs: Vec<PieceSpec> = shown.iter().map(|effect| effect.spec.clone()).collect();
    diagnosis.effects.splice(0..0, specs);
    diagnosis.in_rig = shown;
    Ok(diagnosis)
}

/// The loop on one camera.
fn examine(
    camera: &CameraCapture,
    verify: Option<&CameraCapture>,
    rig: &RigCalibrated,
    options: &RigDiagnoseOptions,
) -> Result<CameraDiagnosis, DiagnoseError> {
    let poses_from_others = !camera.has_markers();
    let (capture, calibrate) = examined(camera, rig, &options.rig)?
        .ok_or_else(|| DiagnoseError::LacksCamera { camera: camera.name.clone() })?;
    let register = match poses_from_others {
        // Projected markers are exact: of effects that images show they say nothing.
        true => of_depth_alone(&calibrate),
        false => calibrate.register.clone(),
    };
    let of_camera = DiagnoseOptions {
        calibrate: CalibrateOptions { register, ..calibrate },
        folds: options.folds,
        formulas: options.formulas,
        thresholds: options.thresholds,
    };
    // In another dataset a camera without images has no poses of its own; its frames are cross-validated.
    let verify = verify.filter(|_| !poses_from_others).map(|v| &v.capture);
    let diagnosis = diagnose(&capture, verify, &of_camera)
        .map_err(|source| DiagnoseError::Camera { camera: camera.name.clone(), source: Box::new(source) })?;
    let added = diagnosis.steps.iter().map(|step| step.spec.clone());
    let piece = |spec: &PieceSpec| diagnosis.last.camera.block(&spec.name).and_then(|block| block.piece());
    let is_map = |spec: &PieceSpec| piece(spec).is_some_and(|piece| piece.field().is_some());
    let (not_adjusted, effects): (Vec<PieceSpec>, Vec<PieceSpec>) = added.partition(is_map);
    Ok(CameraDiagnosis {
        name: camera.name.clone(),
        poses_from_others,
        capture,
        diagnosis,
        in_rig: Vec::new(),
        effects,
        not_adjusted,
    })
}

/// The register without effects of board, lens and pixels that are not declared.
fn of_depth_alone(calibrate: &CalibrateOptions) -> Register {
    let whole = &calibrate.register;
    let is_declared = |name: &str| calibrate.effects.iter().any(|effect| effect.name == name);
    let shows_in_images = |name: &&str| whole.block(name, None).is_ok_and(|block| !is_depth_only(&block));
    let others: Vec<&str> = whole.names().filter(|name| shows_in_images(name) && !is_declared(name)).collect();
    others.into_iter().fold(whole.clone(), |register, name| register.without(name))
}

/// Adds the formulas of all cameras to a register. A name means one formula: where two cameras found different ones of a name,
/// the joint adjustment takes the first over.
fn register_formulas(cameras: &mut [CameraDiagnosis], register: &mut Register) {
    let mut taken: Vec<String> = Vec::new();
    for camera in cameras {
        for formula in &camera.diagnosis.formulas {
            let name = formula.effect.name().to_owned();
            let refused = match taken.contains(&name) {
                true => Some("another camera has a formula of this name".to_owned()),
                false => formula.effect.register(register).err().map(|error| error.to_string()),
            };
            if let Some(reason) = refused {
                info!("{}: {name} is not adjusted jointly: {reason}", camera.name);
                let (out, remaining) = std::mem::take(&mut camera.effects).into_iter().partition(|e| e.name == name);
                camera.effects = remaining;
                let out: Vec<PieceSpec> = out;
                camera.not_adjusted.extend(out);
            }
            taken.push(name);
        }
    }
}

/// The capture without the frames that the diagnosis of a camera left out: of that camera alone.
fn without_bad_frames(capture: &RigCapture, diagnoses: &[CameraDiagnosis]) -> RigCapture {
    let mut usable = capture.clone();
    for (camera, found) in
        usable.cameras.iter_mut().filter_map(|c| diagnoses.iter().find(|d| d.name == c.name).map(|d| (c, d)))
    {
        let is_bad = |name: &str| found.diagnosis.bad_frames.iter().any(|bad| bad.name == name);
        camera.capture = camera.capture.subset(|_, frame| !is_bad(&frame.name));
    }
    usable
}

fn worst(verdicts: impl Iterator<Item = Verdict>) -> Verdict {
    verdicts.fold(Verdict::Adequate, |worst, verdict| match (worst, verdict) {
        (Verdict::Unexplained, _) | (_, Verdict::Unexplained) => Verdict::Unexplained,
        (Verdict::Effect, _) | (_, Verdict::Effect) => Verdict::Effect,
        _ => Verdict::Adequate,
    })
}
