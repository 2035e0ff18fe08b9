//! A dataset fitted and judged.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use depthcal_io::{Calibration, Evaluation, FileError, FileReference, Scores};
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
use crate::calibrate::rig::{RigCalibrated, calibrate_rig};
use crate::calibrate::{CalibrateError, CalibrateOptions, Calibrated, Estimator, calibrate};
use crate::calibration_record::calibration_record;
use crate::diagnose::effect_scores::effect_scores;
use crate::judge::cross_validation::{cross_validate, split};
use crate::judge::evaluate::evaluate;
use crate::judge::parts::Parts;
use crate::judge::rig::{EvaluatedRig, evaluate_rig};
use crate::judge::rig_cross_validation::cross_validate_rig;
use crate::judge::table::table;
use crate::load::{Loaded, LoadedCamera};
use crate::observe::Capture;
use crate::rig_record::rig_record;

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

/// The cameras of a fit.
#[derive(Debug, Clone)]
pub enum Fitted {
    /// One camera.
    Camera(Box<Calibrated>),
    /// Several, with their extrinsics.
    Rig(Box<RigCalibrated>),
}

/// Errors on frames that were not fitted.
#[derive(Debug, Clone)]
pub struct HeldOut {
    /// How these frames were chosen: `held out` or `cross-validated`.
    pub how: &'static str,
    /// The errors.
    pub evaluated: EvaluatedRig,
    /// The frames of one camera that were held out; `None` of a cross-validation, which has a camera for every part, and of a
    /// rig.
    pub capture: Option<Capture>,
}

/// A dataset, fitted and judged.
#[derive(Debug, Clone)]
pub struct Fit {
    /// The dataset.
    pub loaded: Arc<Loaded>,
    /// The cameras.
    pub fitted: Fitted,
    /// Whether only camera and lens were fitted, because there is no depth and no depth model was asked for.
    pub images_only: bool,
    /// Errors on the frames that were fitted.
    pub on_fitted: EvaluatedRig,
    /// Errors on frames that were not.
    pub held_out: Option<HeldOut>,
    /// `calibration.json`.
    pub record: Calibration,
    /// `evaluation.json`.
    pub evaluation: Evaluation,
    /// The pieces that were known, of which the effects are scored for fleets.
    pub register: Register,
}

impl Fitted {
    /// The cameras with their names, the reference first.
    pub fn cameras(&self) -> Vec<(&str, &Calibrated)> {
        match self {
            Self::Camera(calibrated) => vec![(depthcal_io::CAMERA, calibrated)],
            Self::Rig(rig) => rig.cameras.iter().map(|camera| (camera.name.as_str(), &camera.calibrated)).collect(),
        }
    }

    /// The relations between several cameras; `None` of one.
    pub fn rig(&self) -> Option<&RigCalibrated> {
        match self {
            Self::Camera(_) => None,
            Self::Rig(rig) => Some(rig),
        }
    }

    /// The reference; `None` of a rig without cameras, which no fit gives.
    pub fn reference(&self) -> Option<&Calibrated> {
        self.cameras().first().map(|(_, calibrated)| *calibrated)
    }
}

impl FitRequest {
    /// Refuses what a dataset of so many cameras cannot have, and words that mean nothing, before anything is read.
    ///
    /// # Errors
    ///
    /// [`TaskError::Option`], [`TaskError::OneCamera`].
    pub fn check(&self, cameras: usize, register: &Register) -> Result<(), TaskError> {
        let names = self.model.names;
        if cameras == 1 {
            self.priors.iter().find_map(|given| given.camera.as_ref()).map_or(Ok(()), |camera| {
                Err(TaskError::option(
                    names.prior,
                    camera,
                    "names a camera, but the dataset has one: give the file alone",
                ))
            })?;
            return self
                .options(CalibrateOptions { register: register.clone(), ..CalibrateOptions::default() })
                .map(drop);
        }
        self.model.depth_model(register)?;
        if self.estimator != Estimator::Joint {
            let remedy = "all are fitted by the joint one, leave it out".to_owned();
            return Err(TaskError::OneCamera { option: names.estimator, remedy });
        }
        Ok(())
    }

    /// Options of the fit of one camera: those of `base` with what is asked for.
    fn options(&self, base: CalibrateOptions) -> Result<CalibrateOptions, TaskError> {
        Ok(CalibrateOptions { estimator: self.estimator, ..self.model.options(base)? })
    }

    /// Fits a dataset and judges the fit; `base` has the register, which knows the effects, and receives progress.
    ///
    /// # Errors
    ///
    /// [`TaskError`].
    pub fn fit(&self, loaded: &Arc<Loaded>, base: CalibrateOptions) -> Result<Fit, TaskError> {
        self.check(loaded.cameras.len(), &base.register)?;
        match loaded.cameras.as_slice() {
            [camera] => self.fit_camera(camera, loaded, base),
            _ => self.fit_rig(loaded, base),
        }
    }

    /// Where there is no depth, and neither another model than `projective` nor effects are asked for, only camera and lens are
    /// fitted.
    fn fit_camera(
        &self,
        camera: &LoadedCamera,
        loaded: &Arc<Loaded>,
        base: CalibrateOptions,
    ) -> Result<Fit, TaskError> {
        let register = base.register.clone();
        let (capture, held) = match self.hold_out {
            Some(HoldOut { every, first }) => {
                let (fitted, held) = split(&camera.capture, every, first);
                (fitted, Some(held))
            }
            None => (camera.capture.clone(), None),
        };
        let mut options = self.model.for_camera(self.options(base)?, camera)?;
        let size = [capture.width, capture.height];
        let prior = self.priors.first().map(|given| given.for_size(size)).transpose()?;
        options.prior = prior.map(Arc::new);
        let images_only = !capture.has_depth() && self.model.model == "projective" && self.model.with.is_empty();
        if images_only {
            options.model = ModelSpec::none();
        }
        let result = calibrate(&capture, &options)?;
        if let Some(comparison) = &result.lens_comparison {
            // Parts of a cross-validation are fitted with the lens of the whole.
            options.lens.clone_from(&comparison.chosen);
        }
        let stage = options.progress.stage("evaluation");
        let on_fitted = evaluate(&result.camera, &result.capture);
        let on_held = held.as_ref().map(|held| evaluate(&result.camera, held));
        drop(stage);
        let of_camera = |evaluated| EvaluatedRig::of_camera(depthcal_io::CAMERA, evaluated);
        let held_out = self.held_out(on_held.map(of_camera), held, |parts| {
            cross_validate(&result, parts, self.parts, &options).map(of_camera)
        })?;
        let mut record = calibration_record(&result, &on_fitted, camera.reference.clone(), None);
        record.camera.name.clone_from(&camera.declared.name);
        let on_fitted = of_camera(on_fitted);
        let (fitted, evaluation) = (Fitted::Camera(Box::new(result)), evaluation_record(&on_fitted, held_out.as_ref()));
        Ok(Fit { loaded: loaded.clone(), fitted, images_only, on_fitted, held_out, record, evaluation, register })
    }

    /// Errors on frames that were not fitted: `on_held` where frames of one camera, `held`, or of a rig were held out, else those
    /// of a cross-validation by `validate`, given the number of parts, where one is asked for.
    fn held_out(
        &self,
        on_held: Option<EvaluatedRig>,
        held: Option<Capture>,
        validate: impl FnOnce(usize) -> Result<EvaluatedRig, CalibrateError>,
    ) -> Result<Option<HeldOut>, CalibrateError> {
        Ok(match (on_held, self.cross_validate) {
            (Some(evaluated), _) => Some(HeldOut { how: "held out", evaluated, capture: held }),
            (None, Some(parts)) => Some(HeldOut { how: "cross-validated", evaluated: validate(parts)?, capture: None }),
            (None, None) => None,
        })
    }

    /// The priors of a rig's cameras.
    fn priors_of_rig(&self, loaded: &Loaded) -> Result<Vec<(String, Arc<CameraPrior>)>, TaskError> {
        let option = self.model.names.prior;
        let names = || loaded.cameras.iter().map(LoadedCamera::name).collect::<Vec<_>>().join(", ");
        let prior = |given: &GivenPrior| {
            let camera = given.camera.as_deref();
            let camera = loaded.cameras.iter().find(|loaded| Some(loaded.name()) == camera).ok_or_else(|| {
                TaskError::option(
                    option,
                    &given.name,
                    format!("say of which camera it is, CAMERA:FILE; there are {}", names()),
                )
            })?;
            let prior = given.for_size([camera.capture.width, camera.capture.height])?;
            Ok((camera.name().to_owned(), Arc::new(prior)))
        };
        self.priors.iter().map(prior).collect()
    }

    fn fit_rig(&self, loaded: &Arc<Loaded>, base: CalibrateOptions) -> Result<Fit, TaskError> {
        let (register, progress) = (base.register.clone(), base.progress.clone());
        let mut options = self.model.rig_options(base, loaded)?;
        options.priors = self.priors_of_rig(loaded)?;
        let all = loaded.capture(&register)?;
        let (capture, held) = match self.hold_out {
            Some(HoldOut { every, first }) => {
                let names = all.frame_names();
                let is_held = |name: &str| names.iter().position(|n| n == name).is_some_and(|i| i % every == first);
                (all.subset(|name| !is_held(name)), Some(all.subset(is_held)))
            }
            None => (all, None),
        };
        let result = calibrate_rig(&capture, &options)?;
        let placed = result.placed();
        let stage = progress.stage("evaluation");
        let on_fitted = evaluate_rig(&placed, &capture);
        let on_held = held.map(|held| evaluate_rig(&placed, &held));
        drop(stage);
        let held_out =
            self.held_out(on_held, None, |parts| cross_validate_rig(&result, &capture, parts, self.parts, &progress))?;
        let evaluation = evaluation_record(&on_fitted, held_out.as_ref());
        // A dataset without cameras has not been fitted.
        let no_cameras = || CalibrateError::NoImages { dataset: loaded.name.clone() };
        let reference = loaded.cameras.first().map(|camera| camera.reference.clone()).ok_or_else(no_cameras)?;
        let record = rig_record(&result, &on_fitted, reference).ok_or_else(no_cameras)?;
        let (loaded, fitted) = (loaded.clone(), Fitted::Rig(Box::new(result)));
        Ok(Fit { loaded, fitted, images_only: false, on_fitted, held_out, record, evaluation, register })
    }
}

/// The errors on frames that were fitted and on others.
fn evaluation_record(on_fitted: &EvaluatedRig, held_out: Option<&HeldOut>) -> Evaluation {
    let mut evaluation = evaluation_of(on_fitted, "");
    if let Some(HeldOut { how, evaluated, .. }) = held_out {
        extend(&mut evaluation, evaluation_of(evaluated, &format!(" ({how})")));
    }
    evaluation
}

impl Fit {
    /// The errors as a table of text, of one camera with a mark at the dataset that was fitted.
    pub fn table(&self) -> String {
        let fitted = self.fitted.rig().is_none().then_some(self.on_fitted.name.as_str());
        table(&self.evaluation.datasets, fitted)
    }
}

impl Fit {
    /// Writes a folder for every camera with depth, with its own `calibration.json` and `scores.json`, from which a fleet of
    /// cameras of its type can be joined.
    fn write_scores_of_cameras(&self, folder: &Path) -> Result<Vec<PathBuf>, FileError> {
        let mut written = Vec::new();
        for (name, camera) in self.fitted.cameras().into_iter().filter(|(_, camera)| camera.with_depth) {
            let loaded = self.loaded.cameras.iter().find(|loaded| loaded.name() == name);
            let (Some(loaded), Some(evaluated)) = (loaded, self.on_fitted.camera(name)) else { continue };
            let Some(scores) = scores_of(camera, &self.register, loaded) else { continue };
            let camera_folder = folder.join(name);
            std::fs::create_dir_all(&camera_folder)
                .map_err(|error| FileError::Write { path: camera_folder.clone(), error })?;
            calibration_record(camera, evaluated, loaded.reference.clone(), None)
                .write(camera_folder.join("calibration.json"))?;
            scores.write(camera_folder.join("scores.json"))?;
            written.extend(["calibration.json", "scores.json"].map(|file| Path::new(name).join(file)));
        }
        Ok(written)
    }
}

/// The scores of the effects that a camera's model lacks; `None` where none can be scored: a calibration is as good without.
fn scores_of(result: &Calibrated, register: &Register, camera: &LoadedCamera) -> Option<Scores> {
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
        let mut written = match (&self.fitted, self.loaded.cameras.as_slice()) {
            (Fitted::Camera(result), [camera]) => {
                write_calibration(&self.record, result, camera, &self.register, folder)?
            }
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
        let cameras = self.fitted.cameras();
        let cameras = cameras.iter().map(|(name, camera)| ReportCamera::of_rig(name, Some(camera), &datasets));
        let rig = self.fitted.rig().map(|rig| ReportRig {
            cameras: rig.placed(),
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
    result: &Calibrated,
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
