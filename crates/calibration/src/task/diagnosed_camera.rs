//! The diagnosis of one camera, alone or of a rig.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use depthcal_formula::FormulaEffect;
use depthcal_io::{CAMERA, Calibration, CameraDiagnosis as CameraRecord, Evaluation, FileError};
use depthcal_model::{ModelSpec, Register};

use super::evaluated::{evaluation_of, extend};
use super::fit::write_calibration;
use super::made::Made;
use super::report_input::{ReportCamera, ReportDataset, ReportDiagnosis, ReportInput, Role};
use super::results::{Results, Shown};
use crate::calibrate::Calibrated;
use crate::calibration_record::calibration_record;
use crate::diagnose::record::to_file;
use crate::diagnose::separability::separability;
use crate::diagnose::{self, CameraDiagnosis, CameraInRig};
use crate::judge::camera::{EvaluatedCamera, evaluate_camera};
use crate::judge::evaluate::Evaluated;
use crate::load::{Loaded, LoadedCamera};
use crate::progress::ProgressHandle;

/// Diagnosis of a camera: the effects that its model lacks, its errors, and the record.
pub struct DiagnosedCamera {
    /// Name of its captures.
    pub title: String,
    /// The dataset.
    pub loaded: Arc<Loaded>,
    /// Number of the camera in the dataset.
    pub camera: usize,
    /// The loop's result.
    pub diagnosis: CameraDiagnosis,
    /// Errors of the last model on the frames that it was fitted to.
    pub on_fitted: EvaluatedCamera,
    /// Whether the errors on held-out frames are those on another dataset.
    pub verified: bool,
    /// Its record.
    pub record: CameraRecord,
    /// The known pieces, with the formulas that were found.
    pub register: Register,
    /// Of a camera of a rig, what its joint adjustment with the others showed.
    pub in_rig: Option<CameraInRig>,
    /// Sentences that introduce the report.
    pub story: Vec<String>,
}

impl DiagnosedCamera {
    /// The diagnosis of camera number `camera` of a dataset, whose declared model is `model`, with everything that follows
    /// from it. `verified`: errors on held-out frames are those on another dataset.
    pub(super) fn new(
        diagnosed: diagnose::DiagnosedCamera,
        (loaded, camera): (&Arc<Loaded>, usize),
        model: &ModelSpec,
        verified: bool,
        progress: &ProgressHandle,
    ) -> Self {
        let diagnose::DiagnosedCamera { diagnosis, register, in_rig, .. } = diagnosed;
        let stage = progress.stage("evaluation");
        let on_fitted = evaluate_camera(&diagnosis.last.camera, &diagnosis.last.capture);
        drop(stage);
        let loaded_camera = &loaded.cameras[camera];
        let mut record = to_file(&diagnosis, loaded_camera.reference.clone(), model.clone());
        let stage = progress.stage("separability");
        // The matrix is optional in the record; the diagnosis itself has linearised the same model.
        record.separability = separability(&diagnosis, &register).ok();
        drop(stage);
        let (title, loaded) = (loaded_camera.capture.name.clone(), loaded.clone());
        Self { title, loaded, camera, diagnosis, on_fitted, verified, record, register, in_rig, story: Vec::new() }
    }

    /// The camera's part of the dataset.
    pub fn loaded_camera(&self) -> &LoadedCamera {
        &self.loaded.cameras[self.camera]
    }

    /// `calibration.json` of the last model.
    pub fn calibration(&self) -> Calibration {
        let name = if self.in_rig.is_none() { self.loaded_camera().name() } else { CAMERA };
        let fit = Calibrated::of_camera(name, self.diagnosis.last.clone());
        let on_fitted = Evaluated::of_camera(name, self.on_fitted.clone());
        calibration_record(&fit, &on_fitted, self.loaded_camera().reference.clone(), None)
    }

    /// `evaluation.json`: errors of the last model on fitted and on held-out frames.
    pub fn evaluation(&self) -> Evaluation {
        let record = |evaluated: &EvaluatedCamera, suffix: &str| {
            evaluation_of(&Evaluated::of_camera(CAMERA, evaluated.clone()), suffix, |_| Some(&self.diagnosis.last))
        };
        let mut evaluation = record(&self.on_fitted, "");
        extend(&mut evaluation, record(&self.diagnosis.after.evaluated, " (held out)"));
        evaluation
    }

    /// Names of the effects that other cameras, or the joint adjustment with them, showed before the loop.
    pub(super) fn added_in_rig(&self) -> Vec<&str> {
        let in_rig = || self.in_rig.iter();
        let before = in_rig().flat_map(|in_rig| &in_rig.before).map(|effect| &effect.spec);
        in_rig().flat_map(|in_rig| &in_rig.of_board).chain(before).map(|spec| spec.name.as_str()).collect()
    }

    /// Errors of the last model on fitted and on held-out frames, for a report.
    pub(super) fn evaluations(&self) -> Vec<ReportDataset<'_>> {
        let role = if self.verified { Role::Other } else { Role::HeldOut };
        let on_fitted = ReportDataset { evaluated: &self.on_fitted, role: Role::Fitted };
        vec![on_fitted, ReportDataset { evaluated: &self.diagnosis.after.evaluated, role }]
    }

    /// The diagnosis for a report, with the declared model's errors `before`.
    pub(super) fn report<'a>(&'a self, before: &'a EvaluatedCamera) -> ReportDiagnosis<'a> {
        ReportDiagnosis { record: &self.record, before, register: &self.register }
    }
}

impl Results for DiagnosedCamera {
    fn main_file(&self) -> &'static str {
        "calibration.json"
    }

    fn write(&self, folder: &Path) -> Result<Vec<PathBuf>, FileError> {
        depthcal_io::Diagnosis::from(self.record.clone()).write(folder.join("diagnosis.json"))?;
        let (last, camera) = (&self.diagnosis.last, self.loaded_camera());
        let calibration = write_calibration(&self.calibration(), last, camera, &self.register, folder)?;
        self.evaluation().write(folder.join("evaluation.json"))?;
        let names = ["diagnosis.json", "evaluation.json"].map(PathBuf::from);
        Ok(names.into_iter().chain(calibration).collect())
    }

    fn shown(&self, made: &Made) -> Shown<'_> {
        let camera = ReportCamera {
            name: self.loaded_camera().name().to_owned(),
            calibrated: Some(&self.diagnosis.last),
            evaluations: self.evaluations(),
            diagnosis: Some(self.report(&self.diagnosis.before.evaluated)),
            added_in_rig: self.added_in_rig(),
        };
        Shown::Cameras(ReportInput {
            title: self.title.clone(),
            made: made.clone(),
            cameras: vec![camera],
            rig: None,
            story: &self.story,
        })
    }

    fn formulas(&self) -> Vec<&FormulaEffect> {
        self.diagnosis.formulas.iter().map(|formula| &formula.effect).collect()
    }
}
