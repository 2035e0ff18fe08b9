//! Diagnosis of a dataset's cameras: the effects that their models lack.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use depthcal_formula::FormulaEffect;
use depthcal_io::{Calibration, Diagnosis, Evaluation, FileError};
use depthcal_model::Register;

use super::diagnosed_camera::{CameraInRig, DiagnosedCamera};
use super::error::TaskError;
use super::made::Made;
use super::model_request::ModelRequest;
use super::report_input::{ReportCamera, ReportInput, ReportRig, Role};
use super::results::{Results, Shown};
use super::rig_diagnosis::{DiagnosedRig, camera_record};
use crate::calibrate::{CalibrateError, CalibrateOptions};
use crate::diagnose::rig::{RigDiagnoseOptions, diagnose_rig};
use crate::diagnose::{DiagnoseOptions, diagnose};
use crate::load::{Loaded, LoadedCamera};

/// How the models of a dataset's cameras are examined.
#[derive(Debug, Clone)]
pub struct DiagnoseRequest {
    /// The declared model.
    pub model: ModelRequest,
    /// Parts of the cross-validation without another dataset.
    pub folds: usize,
    /// Whether formulas are searched for what the known effects leave unexplained.
    pub formulas: bool,
}

/// The diagnosis of a dataset.
pub struct Diagnosed {
    /// The cameras with depth, by their names.
    pub cameras: Vec<(String, DiagnosedCamera)>,
    /// Of a rig, what was found of its cameras together.
    pub rig: Option<DiagnosedRig>,
    /// `diagnosis.json`.
    pub record: Diagnosis,
}

impl DiagnoseRequest {
    /// Refuses words that mean nothing, before anything is read; effects of a rig are checked when its cameras are known.
    ///
    /// # Errors
    ///
    /// [`TaskError::Option`].
    pub fn check(&self, cameras: usize, register: &Register) -> Result<(), TaskError> {
        if cameras > 1 {
            return self.model.depth_model(register).map(drop);
        }
        self.model.options(CalibrateOptions { register: register.clone(), ..CalibrateOptions::default() }).map(drop)
    }

    /// Diagnoses a dataset, with errors on `verify` where that is given; `base` has the register, which knows the effects, and
    /// receives progress.
    ///
    /// # Errors
    ///
    /// [`TaskError`].
    pub fn diagnose(
        &self,
        loaded: &Arc<Loaded>,
        verify: Option<&Loaded>,
        base: CalibrateOptions,
    ) -> Result<Diagnosed, TaskError> {
        match loaded.cameras.as_slice() {
            [camera] => self.diagnose_camera(camera, loaded, verify, base),
            _ => self.diagnose_rig(loaded, verify, base),
        }
    }

    fn diagnose_camera(
        &self,
        camera: &LoadedCamera,
        loaded: &Arc<Loaded>,
        verify: Option<&Loaded>,
        base: CalibrateOptions,
    ) -> Result<Diagnosed, TaskError> {
        let (register, progress) = (base.register.clone(), base.progress.clone());
        let verify = verify.map(|verify| verify.only_camera()).transpose()?;
        let calibrate = self.model.for_camera(self.model.options(base)?, camera)?;
        let (folds, formulas) = (self.folds, self.formulas);
        let options = DiagnoseOptions { calibrate, folds, formulas, ..DiagnoseOptions::default() };
        let diagnosis = diagnose(&camera.capture, verify.map(|verify| &verify.capture), &options)?;
        let model = self.model.depth_model(&register)?;
        let diagnosed = DiagnosedCamera::new(diagnosis, (loaded, 0), model, verify.is_some(), &register, &progress)?;
        let record = Diagnosis::from(diagnosed.record.clone());
        Ok(Diagnosed { cameras: vec![(camera.declared.name.clone(), diagnosed)], rig: None, record })
    }

    fn diagnose_rig(
        &self,
        loaded: &Arc<Loaded>,
        verify: Option<&Loaded>,
        base: CalibrateOptions,
    ) -> Result<Diagnosed, TaskError> {
        let (register, progress) = (base.register.clone(), base.progress.clone());
        let rig = self.model.rig_options(base, loaded)?;
        let (folds, formulas) = (self.folds, self.formulas);
        let options = RigDiagnoseOptions { rig, folds, formulas, ..RigDiagnoseOptions::default() };
        let other = verify.map(Loaded::observed);
        let mut rig_diagnosis = diagnose_rig(&loaded.capture(&register)?, other.as_ref(), &options)?;
        let no_cameras = || CalibrateError::NoImages { dataset: loaded.name.clone() };
        let (mut cameras, mut records) = (Vec::new(), Vec::new());
        for camera in std::mem::take(&mut rig_diagnosis.cameras) {
            let index = loaded.cameras.iter().position(|l| l.name() == camera.name).ok_or_else(no_cameras)?;
            let verified = verify.is_some() && !camera.poses_from_others;
            let (diagnosis, model) = (camera.diagnosis, self.model.depth_model(&register)?);
            let mut diagnosed =
                DiagnosedCamera::new(diagnosis, (loaded, index), model, verified, &register, &progress)?;
            let in_rig = CameraInRig {
                poses_from_others: camera.poses_from_others,
                before: camera.in_rig,
                effects: camera.effects,
                not_adjusted: camera.not_adjusted,
            };
            records.push(camera_record(&camera.name, &in_rig, diagnosed.record.clone()));
            diagnosed.in_rig = Some(in_rig);
            cameras.push((camera.name, diagnosed));
        }
        let dataset = loaded.cameras.first().map(|camera| camera.reference.clone()).ok_or_else(no_cameras)?;
        let verdict = rig_diagnosis.verdict;
        let rig = DiagnosedRig::new(rig_diagnosis, dataset.clone()).ok_or_else(no_cameras)?;
        let record = Diagnosis { dataset, verdict, cameras: records, rig: Some(rig.findings()) };
        Ok(Diagnosed { cameras, rig: Some(rig), record })
    }
}

impl Diagnosed {
    /// The camera of a dataset that has one.
    pub fn only_camera(&self) -> Option<&DiagnosedCamera> {
        match (&self.rig, self.cameras.as_slice()) {
            (None, [(_, camera)]) => Some(camera),
            _ => None,
        }
    }

    /// `calibration.json` of the last model.
    pub fn calibration(&self) -> Option<Calibration> {
        let of_rig = self.rig.as_ref().map(|rig| rig.calibration.clone());
        of_rig.or_else(|| self.only_camera().map(DiagnosedCamera::calibration))
    }

    /// `evaluation.json` of the last model.
    pub fn evaluation(&self) -> Evaluation {
        let of_rig = self.rig.as_ref().map(|rig| rig.evaluation.clone());
        of_rig.or_else(|| self.only_camera().map(DiagnosedCamera::evaluation)).unwrap_or_default()
    }
}

impl Results for Diagnosed {
    fn main_file(&self) -> &'static str {
        "calibration.json"
    }

    fn write(&self, folder: &Path) -> Result<Vec<PathBuf>, FileError> {
        match (&self.rig, self.only_camera()) {
            (None, Some(camera)) => camera.write(folder),
            _ => {
                self.record.write(folder.join("diagnosis.json"))?;
                if let Some(rig) = &self.rig {
                    rig.calibration.write(folder.join("calibration.json"))?;
                    rig.evaluation.write(folder.join("evaluation.json"))?;
                }
                Ok(["diagnosis.json", "calibration.json", "evaluation.json"].map(PathBuf::from).to_vec())
            }
        }
    }

    fn shown(&self, made: &Made) -> Shown<'_> {
        let Some(rig) = &self.rig else {
            let empty = || Shown::Cameras(ReportInput { made: made.clone(), ..ReportInput::default() });
            return self.only_camera().map_or_else(empty, |camera| camera.shown(made));
        };
        let outcome = &rig.found;
        let datasets = [(&outcome.fitted, Role::Fitted), (&outcome.after, Role::HeldOut)];
        let cameras = outcome.last.cameras.iter().map(|camera| {
            let mut shown = ReportCamera::of_rig(&camera.name, Some(&camera.calibrated), &datasets);
            let diagnosed = self.cameras.iter().find(|(name, _)| *name == camera.name);
            // Errors of the rig that was declared and of the last one, on the same frames.
            let before = outcome.before.camera(&camera.name);
            shown.diagnosis = diagnosed.zip(before).map(|((_, diagnosed), before)| diagnosed.report(before));
            shown
        });
        Shown::Cameras(ReportInput {
            title: outcome.last.name.clone(),
            made: made.clone(),
            cameras: cameras.collect(),
            rig: Some(ReportRig {
                cameras: outcome.last.placed(),
                record: &rig.calibration,
                evaluated: datasets.iter().map(|(evaluated, _)| *evaluated).collect(),
            }),
            story: &[],
        })
    }

    fn formulas(&self) -> Vec<&FormulaEffect> {
        self.only_camera().map(Results::formulas).unwrap_or_default()
    }

    fn parts(&self) -> Vec<(&str, &dyn Results)> {
        match &self.rig {
            Some(_) => self.cameras.iter().map(|(name, camera)| (name.as_str(), camera as &dyn Results)).collect(),
            None => Vec::new(),
        }
    }
}
