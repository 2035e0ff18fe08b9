//! Whole tasks on a rig, from options in words to what the result files hold: the command line and the Python package give the same files
//! because they share this module.

use std::path::Path;

use crate::calibrate::HeldError;
use crate::task::{HoldOut, TaskError};
use depthcal_io::{Calibration, Evaluation};
use thiserror::Error;

use crate::calibrate::CalibrateError;
use crate::calibrate::rig::{EffectOf, HeldOf, RigCalibrated, RigOptions, calibrate_rig};
use crate::judge::rig::{EvaluatedRig, evaluate_rig};
use crate::load::LoadedRig;
use crate::observe::PlacedCamera;
use crate::rig_record::rig_record;

/// What an option calls the time by which a camera exposes later than its times say.
const TIME_OFFSET: &str = "time_offset";

/// A rig, fitted and judged.
#[derive(Debug, Clone)]
pub struct RigFit {
    /// The fit.
    pub result: RigCalibrated,
    /// Its cameras with their places.
    pub placed: Vec<PlacedCamera>,
    /// Errors on the frames that were fitted.
    pub fitted: EvaluatedRig,
    /// Errors on those that were not.
    pub held_out: Option<EvaluatedRig>,
    /// `calibration.json`.
    pub record: Calibration,
    /// `evaluation.json`.
    pub evaluation: Evaluation,
}

/// Adds effects, time offsets and held parameters in words to the options of a fit, whose register knows the effects: `NAME`,
/// `fixed:PIECE.PARAMETER`, and of one camera `CAMERA:NAME`, `CAMERA:time_offset` or `fixed:CAMERA:PIECE.PARAMETER`. `option` is what the
/// caller calls them.
///
/// # Errors
///
/// [`TaskError::Option`] with the text.
pub fn add_effects(
    option: &'static str,
    texts: &[String],
    rig: &LoadedRig,
    options: &mut RigOptions,
) -> Result<(), TaskError> {
    let is_camera = |name: &str| rig.capture.cameras.iter().any(|camera| camera.name == name);
    for text in texts {
        let wrong = |problem: String| TaskError::Option { option: option.to_owned(), text: text.clone(), problem };
        let (is_held, rest) = match text.strip_prefix("fixed:") {
            Some(rest) => (true, rest),
            None => (false, text.as_str()),
        };
        let (camera, rest) = match rest.split_once(':') {
            Some((name, rest)) if is_camera(name) => (Some(name.to_owned()), rest),
            _ => (None, rest),
        };
        if !is_held && rest == TIME_OFFSET {
            let camera = camera.ok_or_else(|| {
                let example = rig.capture.cameras.last().map_or("CAMERA", |camera| camera.name.as_str());
                wrong(format!("name the camera whose offset is estimated, such as {example}:{TIME_OFFSET}"))
            })?;
            options.time_offsets.push(camera);
        } else if is_held {
            let parameter = rest.parse().map_err(|e: HeldError| wrong(e.to_string()))?;
            options.held.push(HeldOf { camera, parameter });
        } else {
            let effect = options.each.register.piece_spec(rest).map_err(|e| wrong(e.to_string()))?;
            options.effects.push(EffectOf { camera, effect });
        }
    }
    Ok(())
}

/// Fits a rig and judges the fit, on the frames of all cameras or without those that are held out.
///
/// # Errors
///
/// [`CalibrateError`].
pub fn fit(rig: &LoadedRig, options: &RigOptions, hold_out: Option<HoldOut>) -> Result<RigFit, CalibrateError> {
    let (capture, held) = match hold_out {
        Some(HoldOut { every, first }) => {
            let all = rig.capture.frame_names();
            let is_held = |name: &str| all.iter().position(|n| n == name).is_some_and(|i| i % every == first);
            (rig.capture.subset(|name| !is_held(name)), Some(rig.capture.subset(is_held)))
        }
        None => (rig.capture.clone(), None),
    };
    let result = calibrate_rig(&capture, options)?;
    let placed = result.placed();
    let stage = options.each.progress.stage("evaluation");
    let fitted = evaluate_rig(&placed, &capture);
    let held_out = held.map(|held| evaluate_rig(&placed, &held));
    drop(stage);
    let mut evaluation = evaluation_of(&[&fitted], "");
    if let Some(held_out) = &held_out {
        extend(&mut evaluation, evaluation_of(&[held_out], " (held out)"));
    }
    // A dataset without cameras has not been fitted.
    let no_cameras = || CalibrateError::NoImages { dataset: rig.dataset.name.clone() };
    let reference = rig.cameras.first().map(|camera| camera.reference.clone()).ok_or_else(no_cameras)?;
    let record = rig_record(&result, &fitted, reference).ok_or_else(no_cameras)?;
    Ok(RigFit { result, placed, fitted, held_out, record, evaluation })
}

/// The record of errors of a rig on some captures, `suffix` being added to their names.
pub fn evaluation_of(rigs: &[&EvaluatedRig], suffix: &str) -> Evaluation {
    let mut datasets: Vec<_> = rigs.iter().flat_map(|rig| rig.records()).collect();
    let mut transfer: Vec<_> = rigs.iter().flat_map(|rig| rig.transfer_records()).collect();
    datasets.iter_mut().for_each(|d| d.name += suffix);
    transfer.iter_mut().for_each(|t| t.dataset += suffix);
    Evaluation { datasets, transfer }
}

/// Adds the errors on further captures to a record.
pub(crate) fn extend(evaluation: &mut Evaluation, more: Evaluation) {
    evaluation.datasets.extend(more.datasets);
    evaluation.transfer.extend(more.transfer);
}

/// Why a calibration cannot be evaluated on a dataset of a rig.
#[derive(Debug, Error)]
pub enum UnlikeRig {
    /// Images of a camera have another size than it was calibrated for.
    #[error(
        "{path}: images of camera {camera} are {} × {} px, but its calibration is for {} × {} px",
        found[0], found[1], expected[0], expected[1]
    )]
    Size {
        /// The dataset.
        path: String,
        /// The camera.
        camera: String,
        /// Width and height of its images, px.
        found: [usize; 2],
        /// Those of its calibration.
        expected: [usize; 2],
    },
    /// The dataset has no camera of the calibration.
    #[error(
        "{path}: none of its cameras ({has}) is in the calibration ({calibrated}): give the sections [cameras.NAME] the names of the \
         calibration"
    )]
    Names {
        /// The dataset.
        path: String,
        /// Names of its cameras.
        has: String,
        /// Names of the calibrated cameras.
        calibrated: String,
    },
}

/// Checks that cameras of a calibration are those of a dataset; returns the names of those that the dataset does not have.
///
/// # Errors
///
/// [`UnlikeRig`].
pub fn missing_cameras(cameras: &[PlacedCamera], rig: &LoadedRig, path: &Path) -> Result<Vec<String>, UnlikeRig> {
    let path = path.display().to_string();
    let mut missing = Vec::new();
    for camera in cameras {
        let Some(own) = rig.capture.cameras.iter().find(|own| own.name == camera.name) else {
            missing.push(camera.name.clone());
            continue;
        };
        let (found, expected) = ([own.capture.width, own.capture.height], [camera.camera.width, camera.camera.height]);
        if found != expected {
            return Err(UnlikeRig::Size { path, camera: camera.name.clone(), found, expected });
        }
    }
    if missing.len() == cameras.len() {
        let has: Vec<&str> = rig.capture.cameras.iter().map(|own| own.name.as_str()).collect();
        return Err(UnlikeRig::Names { path, has: has.join(", "), calibrated: missing.join(", ") });
    }
    Ok(missing)
}
