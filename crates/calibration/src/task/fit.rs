//! A dataset fitted and judged.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use depthcal_io::{CAMERA, Calibration, Evaluation, FileError, FileReference, Scores};
use depthcal_model::{ModelSpec, Register};
use tracing::warn;

use super::error::TaskError;
use super::evaluated::{evaluation_of, extend};
use super::made::Made;
use super::model_request::ModelRequest;
use super::prior::GivenPrior;
use super::report_input::{ReportCamera, ReportInput, ReportRig, Role};
use super::results::{Results, Shown};
use crate::adjust::camera_prior::CameraPrior;
use crate::calibrate::{CalibrateError, Calibrated, CalibratedCamera, CameraFit, CameraOptions, Estimator, calibrate};
use crate::calibration_record::calibration_record;
use crate::diagnose::effect_scores::effect_scores;
use crate::judge::capture_cross_validation::cross_validate;
use crate::judge::evaluate::{Evaluated, evaluate, evaluate_fitted};
use crate::judge::parts::Parts;
use crate::judge::table::table;
use crate::load::{Loaded, LoadedCamera};
use crate::observe::Capture;

/// Name of the file of observations; the calibration refers to it.
const OBSERVATIONS: &str = "observations.json";

/// Every `every`-th frame, beginning with number `first` (from 0).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HoldOut {
    /// Period in frames, at least 2.
    pub every: usize,
    /// The first held-out frame, below `every`.
    pub first: usize,
}

/// Request of a fit to a dataset: the model, its estimation, and the frames on which it is judged.
#[derive(Debug, Clone)]
pub struct FitRequest {
    /// The model.
    pub model: ModelRequest,
    /// How the depth model is estimated.
    pub estimator: Estimator,
    /// Frames that are not fitted but evaluated.
    pub hold_out: Option<HoldOut>,
    /// Parts of a cross-validation; not together with `hold_out`.
    pub cross_validate: Option<usize>,
    /// How frames are divided into these parts.
    pub parts: Parts,
    /// Priors from other units of the cameras' types, at most one for every camera.
    pub priors: Vec<GivenPrior>,
}

/// Errors on frames that were not fitted.
#[derive(Debug, Clone)]
pub struct HeldOut {
    /// How these frames were chosen: `held out` or `cross-validated`.
    pub how: &'static str,
    /// The errors.
    pub evaluated: Evaluated,
    /// The frames that were held out; `None` of a cross-validation, which has cameras for every part.
    pub capture: Option<Capture>,
}

/// A dataset, fitted and judged.
#[derive(Debug, Clone)]
pub struct Fit {
    /// The dataset.
    pub loaded: Arc<Loaded>,
    /// The cameras.
    pub fitted: Calibrated,
    /// Whether only camera and lens were fitted, because there is no depth and no depth model was asked for.
    pub images_only: bool,
    /// Errors on the frames that were fitted.
    pub on_fitted: Evaluated,
    /// Errors on frames that were not.
    pub held_out: Option<HeldOut>,
    /// `calibration.json`.
    pub record: Calibration,
    /// `evaluation.json`.
    pub evaluation: Evaluation,
    /// The pieces that were known, of which the effects are scored for fleets.
    pub register: Register,
}

impl FitRequest {
    /// Refuses what a dataset of so many cameras cannot have, and words that mean nothing, before anything is read; effects of
    /// several cameras are checked when these are known.
    ///
    /// # Errors
    ///
    /// [`TaskError::Option`], [`TaskError::OneCamera`].
    pub fn check(&self, cameras: usize, register: &Register) -> Result<(), TaskError> {
        let names = self.model.names;
        self.model.check(cameras, register)?;
        if cameras > 1 && self.estimator != Estimator::Joint {
            let remedy = "all are fitted by the joint one, leave it out".to_owned();
            return Err(TaskError::OneCamera { option: names.estimator, remedy });
        }
        match self.priors.iter().find_map(|given| given.camera.as_ref()) {
            Some(camera) if cameras == 1 => Err(TaskError::option(
                names.prior,
                camera,
                "names a camera, but the dataset has one: give the file alone",
            )),
            _ => Ok(()),
        }
    }

    /// Fits a dataset and judges the fit; `base` has the register, which knows the effects, and receives progress. Where there is
    /// no depth, and neither another model than `projective` nor effects are asked for, only cameras and lenses are fitted.
    ///
    /// # Errors
    ///
    /// [`TaskError`].
    pub fn fit(&self, loaded: &Arc<Loaded>, base: CameraOptions) -> Result<Fit, TaskError> {
        self.check(loaded.cameras.len(), &base.register)?;
        let (register, progress) = (base.register.clone(), base.progress.clone());
        let base = CameraOptions { estimator: self.estimator, ..base };
        let mut options = self.model.options(base, loaded)?;
        options.priors = self.priors(loaded)?;
        let all = loaded.capture(self.model.lens.as_deref(), &register)?;
        let (capture, held) = match self.hold_out {
            Some(HoldOut { every, first }) => {
                let (fitted, held) = all.split(every, first);
                (fitted, Some(held))
            }
            None => (all, None),
        };
        self.check_parts(&capture)?;
        let images_only = !capture.has_depth() && self.model.model == "projective" && self.model.with.is_empty();
        if images_only {
            options.each.model = ModelSpec::none();
        }
        let fitted = calibrate(&capture, &options)?;
        fitted.cameras.iter().for_each(warn_of_unknown_focal_length);
        let stage = progress.stage("evaluation");
        let on_fitted = evaluate_fitted(&fitted);
        let on_held = held.as_ref().map(|held| evaluate(&fitted.placed(), held));
        drop(stage);
        let held_out = match (on_held, self.cross_validate) {
            (Some(evaluated), _) => Some(HeldOut { how: "held out", evaluated, capture: held }),
            (None, Some(parts)) => {
                let evaluated = cross_validate(&fitted, &capture, parts, self.parts, &options)?;
                Some(HeldOut { how: "cross-validated", evaluated, capture: None })
            }
            (None, None) => None,
        };
        // A dataset without cameras has not been fitted.
        let no_cameras = || CalibrateError::NoImages { dataset: loaded.name.clone() };
        let reference = loaded.cameras.first().map(|camera| camera.reference.clone()).ok_or_else(no_cameras)?;
        let record = calibration_record(&fitted, &on_fitted, reference, None);
        let evaluation = evaluation_record(&fitted, &on_fitted, held_out.as_ref());
        Ok(Fit { loaded: loaded.clone(), fitted, images_only, on_fitted, held_out, record, evaluation, register })
    }

    /// Refuses a cross-validation in more parts than there are frames.
    fn check_parts(&self, capture: &Capture) -> Result<(), TaskError> {
        let names = capture.cameras.iter().flat_map(|camera| &camera.capture.frames).map(|frame| &frame.name);
        let frames = names.collect::<BTreeSet<_>>().len();
        let Some(parts) = self.cross_validate.filter(|parts| *parts > frames) else { return Ok(()) };
        let problem = format!("asks for more parts than there are frames with a board, {frames}: give at most as many");
        Err(TaskError::option(self.model.names.cross_validate, &parts.to_string(), problem))
    }

    /// The priors of the cameras.
    fn priors(&self, loaded: &Loaded) -> Result<Vec<(String, Arc<CameraPrior>)>, TaskError> {
        let option = self.model.names.prior;
        let names = || loaded.cameras.iter().map(LoadedCamera::name).collect::<Vec<_>>().join(", ");
        let prior = |given: &GivenPrior| {
            let named = |camera: &&LoadedCamera| given.camera.as_deref() == Some(camera.name());
            let camera = match &loaded.cameras[..] {
                [only] => Some(only),
                several => several.iter().find(named),
            };
            let problem = || format!("say of which camera it is, CAMERA:FILE; there are {}", names());
            let camera = camera.ok_or_else(|| TaskError::option(option, &given.name, problem()))?;
            let prior = given.for_size([camera.capture.width, camera.capture.height])?;
            Ok((camera.name().to_owned(), Arc::new(prior)))
        };
        self.priors.iter().map(prior).collect()
    }
}

/// Warns where the frames of a camera do not determine its focal length, or contradict each other about it.
fn warn_of_unknown_focal_length(camera: &CameraFit) {
    let CameraFit { name, calibrated, .. } = camera;
    if let Some([fx, std_dev]) = calibrated.unknown_focal_length() {
        let noise = match camera.has_markers() {
            true => format!(" (noise of a marker {:.3} px)", calibrated.noise.pixel_sigma),
            false => String::new(),
        };
        warn!(
            "{name}: the focal length is hardly known, {fx:.0} ± {std_dev:.0} px: too few boards are tilted (by 20° to 45°, near and far), some \
             frames are of another camera, of another zoom, or have depth that is not theirs{noise}, or the model lacks an effect, which diagnose \
             looks for"
        );
    }
}

/// The errors of a fit on frames that were fitted and on others.
fn evaluation_record(fitted: &Calibrated, on_fitted: &Evaluated, held_out: Option<&HeldOut>) -> Evaluation {
    let fit = |name: &str| fitted.camera(name).map(|camera| &camera.calibrated);
    let mut evaluation = evaluation_of(on_fitted, "", fit);
    if let Some(HeldOut { how, evaluated, .. }) = held_out {
        extend(&mut evaluation, evaluation_of(evaluated, &format!(" ({how})"), fit));
    }
    evaluation
}

impl Fit {
    /// The errors as a table of text, of one camera with a mark at the dataset that was fitted.
    pub fn table(&self) -> String {
        let fitted = self.fitted.only_camera().map(|_| self.on_fitted.name.as_str());
        table(&self.evaluation.datasets, fitted)
    }
}

impl Fit {
    /// Writes a folder for every camera with depth, with its own `calibration.json` and `scores.json`, from which a fleet of
    /// cameras of its type can be joined.
    fn write_scores_of_cameras(&self, folder: &Path) -> Result<Vec<PathBuf>, FileError> {
        let mut written = Vec::new();
        for CameraFit { name, calibrated, .. } in self.fitted.cameras.iter().filter(|c| c.calibrated.with_depth) {
            let loaded = self.loaded.cameras.iter().find(|loaded| loaded.name() == name);
            let (Some(loaded), Some(evaluated)) = (loaded, self.on_fitted.camera(name)) else { continue };
            let Some(scores) = scores_of(calibrated, &self.register, loaded) else { continue };
            let camera_folder = folder.join(name);
            std::fs::create_dir_all(&camera_folder)
                .map_err(|error| FileError::Write { path: camera_folder.clone(), error })?;
            let alone = Calibrated::of_camera(CAMERA, calibrated.clone());
            let evaluated = Evaluated::of_camera(CAMERA, evaluated.clone());
            calibration_record(&alone, &evaluated, loaded.reference.clone(), None)
                .write(camera_folder.join("calibration.json"))?;
            scores.write(camera_folder.join("scores.json"))?;
            written.extend(["calibration.json", "scores.json"].map(|file| Path::new(name).join(file)));
        }
        Ok(written)
    }
}

/// The scores of the effects that a camera's model lacks; `None` where none can be scored: a calibration is as good without.
fn scores_of(result: &CalibratedCamera, register: &Register, camera: &LoadedCamera) -> Option<Scores> {
    effect_scores(result, register, camera.reference.clone()).unwrap_or_else(|error| {
        warn!("no scores.json: {error}");
        None
    })
}

impl Results for Fit {
    fn main_file(&self) -> &'static str {
        "calibration.json"
    }

    fn write(&self, folder: &Path) -> Result<Vec<PathBuf>, FileError> {
        let mut written = match (self.fitted.only_camera(), self.loaded.cameras.as_slice()) {
            (Some(result), [camera]) => write_calibration(&self.record, result, camera, &self.register, folder)?,
            _ => {
                self.record.write(folder.join("calibration.json"))?;
                let mut written = vec![PathBuf::from("calibration.json")];
                written.extend(self.write_scores_of_cameras(folder)?);
                written
            }
        };
        self.evaluation.write(folder.join("evaluation.json"))?;
        written.push(PathBuf::from("evaluation.json"));
        Ok(written)
    }

    fn shown(&self, made: &Made) -> Shown<'_> {
        let mut datasets = vec![(&self.on_fitted, Role::Fitted)];
        datasets.extend(self.held_out.as_ref().map(|held| (&held.evaluated, Role::HeldOut)));
        let cameras = self.fitted.cameras.iter();
        let cameras = cameras.map(|camera| ReportCamera::of_rig(&camera.name, Some(&camera.calibrated), &datasets));
        let rig = (self.fitted.cameras.len() > 1).then(|| ReportRig {
            cameras: self.fitted.placed(),
            record: &self.record,
            evaluated: datasets.iter().map(|(evaluated, _)| *evaluated).collect(),
        });
        Shown::Cameras(ReportInput {
            title: self.on_fitted.name.clone(),
            made: made.clone(),
            cameras: cameras.collect(),
            rig,
            story: &[],
        })
    }
}

/// Writes `observations.json`, `calibration.json` and, where effects can be scored, `scores.json` of one camera into a folder;
/// returns their names. `register` has the effects to score.
pub(super) fn write_calibration(
    record: &Calibration,
    result: &CalibratedCamera,
    camera: &LoadedCamera,
    register: &Register,
    folder: &Path,
) -> Result<Vec<PathBuf>, FileError> {
    camera.observations().write(folder.join(OBSERVATIONS))?;
    let observations = FileReference { path: OBSERVATIONS.to_owned(), digest: camera.reference.digest.clone() };
    Calibration { observations: Some(observations), ..record.clone() }.write(folder.join("calibration.json"))?;
    let mut written = ["calibration.json", OBSERVATIONS].map(PathBuf::from).to_vec();
    if let Some(scores) = scores_of(result, register, camera) {
        scores.write(folder.join("scores.json"))?;
        written.push(PathBuf::from("scores.json"));
    }
    Ok(written)
}
