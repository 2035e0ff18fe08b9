//! `diagnose`: what a model lacks.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use depthcal_calibration::calibration_record::calibration_record;
use depthcal_calibration::diagnose::{DiagnoseOptions, Diagnosis as Found, diagnose as search};
use depthcal_calibration::judge::evaluate::{Evaluated, evaluate};
use depthcal_calibration::load::Loaded;
use depthcal_calibration::load::LoadedRig;
use depthcal_calibration::stage_clock::StageTimes;
use depthcal_calibration::task::{diagnosis_record, write_calibration};
use depthcal_io::{DatasetEvaluation, DiagnosisFile, Evaluation};
use depthcal_model::Register;
use depthcal_report::{
    ReportDataset, ReportDiagnosis, ReportInput, Role, diagnosis_text, effect_files, verdict_sentence,
};
use pyo3::prelude::*;

use crate::calibrated::Calibration;
use crate::dataset::Dataset;
use crate::effect::Effect;
use crate::failure::{Failure, input};
use crate::request::{base_options, checked_folds, json, model_request, register_with};
use crate::running::run;
use crate::written::{html, save_together, write_report, write_text};

/// What was examined: a dataset, or a camera of a rig by its index.
pub(crate) enum Examined {
    Dataset(Arc<Loaded>),
    OfRig(Arc<LoadedRig>, usize),
}

impl Examined {
    fn loaded(&self) -> &Loaded {
        match self {
            Self::Dataset(loaded) => loaded,
            Self::OfRig(rig, camera) => &rig.cameras[*camera],
        }
    }
}

/// A diagnosis.
#[pyclass(frozen, module = "depthcal._depthcal")]
pub(crate) struct Diagnosis {
    pub(crate) found: Box<Found>,
    pub(crate) fitted: Evaluated,
    pub(crate) record: DiagnosisFile,
    /// With the formulas that were found.
    pub(crate) register: Register,
    pub(crate) loaded: Examined,
    pub(crate) title: String,
    pub(crate) verified: bool,
    pub(crate) stages: StageTimes,
    pub(crate) call: String,
}

/// Finds what a model lacks.
#[pyfunction]
#[pyo3(signature = (dataset, verify, model, with, effects, lens, folds, discovery, call, progress))]
#[expect(clippy::too_many_arguments, reason = "called by one Python function, which names them")]
pub(crate) fn diagnose(
    py: Python<'_>,
    dataset: &Dataset,
    verify: Option<PyRef<'_, Dataset>>,
    model: String,
    with: Vec<String>,
    effects: Vec<PyRef<'_, Effect>>,
    lens: Option<String>,
    folds: usize,
    discovery: bool,
    call: String,
    progress: Option<Py<PyAny>>,
) -> PyResult<Diagnosis> {
    let folds = checked_folds(folds)?;
    let mut register = register_with(&effects)?;
    let request = model_request(model, with, lens, &mut register)?;
    let loaded = dataset.loaded.clone();
    let verify = verify.map(|dataset| dataset.loaded.clone());
    run(py, progress.as_ref(), move |progress| {
        let calibrate = request.for_dataset(request.options(base_options(&register, progress))?, &loaded)?;
        let options = DiagnoseOptions { calibrate, folds, formulas: discovery, ..DiagnoseOptions::default() };
        let found = search(&loaded.capture, verify.as_ref().map(|verify| &verify.capture), &options)?;
        let stage = progress.stage("evaluation");
        let fitted = evaluate(&found.last.camera, &found.last.capture);
        drop(stage);
        let (record, register) =
            diagnosis_record(&found, loaded.reference.clone(), &request.model, &register, progress).map_err(input)?;
        let (verified, stages) = (verify.is_some(), progress.stage_times());
        let (title, loaded) = (loaded.capture.name.clone(), Examined::Dataset(loaded));
        Ok(Diagnosis { found: Box::new(found), fitted, record, register, loaded, title, verified, stages, call })
    })
}

impl Diagnosis {
    /// Errors of the last model, on fitted and on held-out frames.
    fn datasets(&self) -> Vec<DatasetEvaluation> {
        let mut held_out = self.found.after.evaluated.record();
        held_out.name = format!("{} (held out)", held_out.name);
        vec![self.fitted.record(), held_out]
    }

    fn report<T>(&self, make: impl FnOnce(&ReportInput<'_>) -> Result<T, Failure>) -> Result<T, Failure> {
        let found = &self.found;
        let role = if self.verified { Role::Other } else { Role::HeldOut };
        let shown = [
            ReportDataset { evaluated: &self.fitted, role: Role::Fitted },
            ReportDataset { evaluated: &found.after.evaluated, role },
        ];
        let diagnosis =
            ReportDiagnosis { record: &self.record, before: &found.before.evaluated, register: &self.register };
        make(&ReportInput {
            title: self.title.clone(),
            command_line: self.call.clone(),
            stages: self.stages.clone(),
            calibrated: Some(&found.last),
            evaluations: &shown,
            diagnosis: Some(diagnosis),
            story: &[],
        })
    }
}

impl Diagnosis {
    /// Writes all files into a folder; returns their names.
    pub(crate) fn write(&self, out: &Path) -> Result<Vec<PathBuf>, Failure> {
        self.record.write(out.join("diagnosis.json")).map_err(input)?;
        let (last, loaded) = (&self.found.last, self.loaded.loaded());
        write_calibration(last, &self.fitted, loaded, self.datasets(), &self.register, out).map_err(input)?;
        self.report(|report| write_report(report, out))?;
        let mut written = ["diagnosis.json", "calibration.json", "report.html"].map(PathBuf::from).to_vec();
        for formula in &self.found.formulas {
            for (name, text) in effect_files(&formula.effect) {
                let name = PathBuf::from("effects").join(name);
                write_text(out.join(&name), &text)?;
                written.push(name);
            }
        }
        Ok(written)
    }
}

#[pymethods]
impl Diagnosis {
    /// The record as JSON: `diagnosis.json`.
    fn json(&self) -> PyResult<String> {
        json(&self.record)
    }

    /// The diagnosis in words.
    fn text(&self) -> String {
        diagnosis_text(&self.record)
    }

    /// Its verdict in a sentence.
    fn sentence(&self) -> String {
        verdict_sentence(&self.record)
    }

    /// The calibration of the last model.
    fn calibration(&self) -> Calibration {
        let last = &self.found.last;
        let record = calibration_record(last, &self.fitted, self.loaded.loaded().reference.clone(), None);
        Calibration::new(record, last.camera.clone(), self.register.clone())
    }

    /// The formulas that were found, as effects.
    fn formulas(&self) -> Vec<Effect> {
        self.found.formulas.iter().map(|formula| Effect::of_formula(formula.effect.clone())).collect()
    }

    /// Errors of the last model as JSON: `evaluation.json`.
    fn evaluation(&self) -> PyResult<String> {
        json(&Evaluation { datasets: self.datasets(), ..Evaluation::default() })
    }

    /// The report as HTML.
    fn report_html(&self, py: Python<'_>) -> PyResult<String> {
        run(py, None, |_| self.report(html))
    }

    /// Writes `diagnosis.json`, `calibration.json`, `evaluation.json`, `observations.json`, `report.html` and the files of formulas that
    /// were found into a folder; returns the paths.
    fn save(&self, py: Python<'_>, out: PathBuf) -> PyResult<Vec<PathBuf>> {
        run(py, None, |_| save_together(&out, "calibration.json", |out| self.write(out)))
    }
}
