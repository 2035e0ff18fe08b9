//! Diagnosis of a dataset's cameras: the effects that their models lack.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use depthcal_formula::FormulaEffect;
use depthcal_io::{Calibration, Diagnosis, Evaluation, FileError};
use depthcal_model::Register;

use super::diagnosed_camera::DiagnosedCamera;
use super::error::TaskError;
use super::made::Made;
use super::model_request::ModelRequest;
use super::report_input::{ReportCamera, ReportInput, ReportRig, Role};
use super::results::{Results, Shown};
use super::rig_diagnosis::{DiagnosedRig, diagnosed_record};
use crate::calibrate::{CalibrateError, CameraOptions};
use crate::diagnose::{DiagnoseOptions, diagnose};
use crate::load::Loaded;

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
    /// The pieces that were known before: formulas that were found are in the records.
    pub register: Register,
}

impl DiagnoseRequest {
    /// Refuses words that mean nothing, before anything is read; effects of several cameras are checked when these are known.
    ///
    /// # Errors
    ///
    /// [`TaskError::Option`].
    pub fn check(&self, cameras: usize, register: &Register) -> Result<(), TaskError> {
        self.model.check(cameras, register)
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
        base: CameraOptions,
    ) -> Result<Diagnosed, TaskError> {
        let (register, progress) = (base.register.clone(), base.progress.clone());
        if let ([_], Some(verify)) = (&loaded.cameras[..], verify) {
            verify.only_camera()?;
        }
        let (folds, formulas) = (self.folds, self.formulas);
        let calibrate = self.model.options(base, loaded)?;
        let options = DiagnoseOptions { calibrate, folds, formulas, ..DiagnoseOptions::default() };
        let capture = loaded.capture(self.model.lens.as_deref(), &register)?;
        let model = self.model.depth_model(&register)?;
        let diagnosis = diagnose(&capture, verify.map(Loaded::observed).as_ref(), &options)?;
        let no_cameras = || CalibrateError::NoImages { dataset: loaded.name.clone() };
        let mut cameras = Vec::new();
        for camera in diagnosis.cameras {
            let index = loaded.cameras.iter().position(|l| l.name() == camera.name).ok_or_else(no_cameras)?;
            let name = camera.name.clone();
            cameras.push((name, DiagnosedCamera::new(camera, (loaded, index), &model, verify.is_some(), &progress)));
        }
        let dataset = loaded.cameras.first().map(|camera| camera.reference.clone()).ok_or_else(no_cameras)?;
        let rig = diagnosis.rig.map(|rig| DiagnosedRig::new(rig, dataset.clone()));
        let record = match (&rig, &cameras[..]) {
            (None, [(_, only)]) => Diagnosis::from(only.record.clone()),
            _ => Diagnosis {
                dataset,
                verdict: diagnosis.verdict,
                cameras: cameras.iter().map(|(name, camera)| diagnosed_record(name, camera)).collect(),
                rig: rig.as_ref().map(DiagnosedRig::findings),
            },
        };
        Ok(Diagnosed { cameras, rig, record, register })
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
            let Some((_, diagnosed)) = diagnosed else { return shown };
            shown.added_in_rig = diagnosed.added_in_rig();
            if shown.evaluations.is_empty() {
                // Without images it has the errors of its loop, to which the other cameras give the poses.
                shown.evaluations = diagnosed.evaluations();
            }
            // Errors of the rig that was declared and of the last one, on the same frames.
            let before = outcome.before.camera(&camera.name);
            shown.diagnosis = Some(diagnosed.report(before.unwrap_or(&diagnosed.diagnosis.before.evaluated)));
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
