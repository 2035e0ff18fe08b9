//! The diagnosis of one camera, alone or of a rig.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use depthcal_formula::{FormulaEffect, FormulaError};
use depthcal_io::{Calibration, CameraDiagnosis, Evaluation, FileError};
use depthcal_model::{ModelSpec, PieceSpec, Register};

use super::evaluated::{evaluation_of, extend};
use super::fit::write_calibration;
use super::made::Made;
use super::report_input::{ReportCamera, ReportDataset, ReportDiagnosis, ReportInput, Role};
use super::results::{Results, Shown};
use crate::calibration_record::calibration_record;
use crate::diagnose::Diagnosis;
use crate::diagnose::record::to_file;
use crate::diagnose::rig::EffectInRig;
use crate::diagnose::separability::separability;
use crate::judge::evaluate::{Evaluated, evaluate};
use crate::judge::rig::EvaluatedRig;
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
    pub diagnosis: Diagnosis,
    /// Errors of the last model on the frames that it was fitted to.
    pub on_fitted: Evaluated,
    /// Whether the errors on held-out frames are those on another dataset.
    pub verified: bool,
    /// Its record.
    pub record: CameraDiagnosis,
    /// The known pieces, with the formulas that were found.
    pub register: Register,
    /// Of a camera of a rig, what its joint adjustment with the others showed.
    pub in_rig: Option<CameraInRig>,
    /// Sentences that introduce the report.
    pub story: Vec<String>,
}

/// Findings on one camera from the joint adjustment of its rig.
pub struct CameraInRig {
    /// Whether the poses of the board come from the other cameras, because this one has no images.
    pub poses_from_others: bool,
    /// Effects that it showed before the loop, which is given them.
    pub before: Vec<EffectInRig>,
    /// Effects that it took over, as for `calibrate --with`.
    pub effects: Vec<PieceSpec>,
    /// Effects that it did not.
    pub not_adjusted: Vec<PieceSpec>,
}

impl DiagnosedCamera {
    /// The diagnosis of camera number `camera` of a dataset, whose declared model is `model`, with everything that follows
    /// from it.
    ///
    /// # Errors
    ///
    /// [`FormulaError`] where a formula cannot be a piece.
    pub(super) fn new(
        diagnosis: Diagnosis,
        (loaded, camera): (&Arc<Loaded>, usize),
        model: ModelSpec,
        verified: bool,
        register: &Register,
        progress: &ProgressHandle,
    ) -> Result<Self, FormulaError> {
        let stage = progress.stage("evaluation");
        let on_fitted = evaluate(&diagnosis.last.camera, &diagnosis.last.capture);
        drop(stage);
        let mut register = register.clone();
        for formula in &diagnosis.formulas {
            formula.effect.register(&mut register)?;
        }
        let reference = &loaded.cameras[camera].reference;
        let mut record = to_file(&diagnosis, reference.clone(), model);
        let stage = progress.stage("separability");
        // The matrix is optional in the record; the diagnosis itself has linearised the same model.
        record.separability = separability(&diagnosis, &register).ok();
        drop(stage);
        let (title, loaded) = (loaded.cameras[camera].capture.name.clone(), loaded.clone());
        let (in_rig, story) = (None, Vec::new());
        Ok(Self { title, loaded, camera, diagnosis, on_fitted, verified, record, register, in_rig, story })
    }

    /// The camera's part of the dataset.
    pub fn loaded_camera(&self) -> &LoadedCamera {
        &self.loaded.cameras[self.camera]
    }

    /// `calibration.json` of the last model.
    pub fn calibration(&self) -> Calibration {
        let camera = self.loaded_camera();
        let mut record = calibration_record(&self.diagnosis.last, &self.on_fitted, camera.reference.clone(), None);
        if self.in_rig.is_none() {
            record.camera.name.clone_from(&camera.declared.name);
        }
        record
    }

    /// `evaluation.json`: errors of the last model on fitted and on held-out frames.
    pub fn evaluation(&self) -> Evaluation {
        let record = |evaluated: &Evaluated, suffix: &str| {
            evaluation_of(&EvaluatedRig::of_camera(depthcal_io::CAMERA, evaluated.clone()), suffix)
        };
        let mut evaluation = record(&self.on_fitted, "");
        extend(&mut evaluation, record(&self.diagnosis.after.evaluated, " (held out)"));
        evaluation
    }

    /// The diagnosis for a report, with the declared model's errors `before`.
    pub(super) fn report<'a>(&'a self, before: &'a Evaluated) -> ReportDiagnosis<'a> {
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
        let (before, after) = (&self.diagnosis.before.evaluated, &self.diagnosis.after.evaluated);
        let role = if self.verified { Role::Other } else { Role::HeldOut };
        let on_fitted = ReportDataset { evaluated: &self.on_fitted, role: Role::Fitted };
        let camera = ReportCamera {
            name: self.loaded_camera().name().to_owned(),
            calibrated: Some(&self.diagnosis.last),
            evaluations: vec![on_fitted, ReportDataset { evaluated: after, role }],
            diagnosis: Some(self.report(before)),
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
