//! `diagnose` on rigs: what the models of all cameras lack.

use std::path::PathBuf;

use depthcal_calibration::diagnose::rig::{RigDiagnoseOptions, RigDiagnosis as Found, diagnose_rig};
use depthcal_calibration::judge::evaluate::evaluate;
use depthcal_calibration::judge::table::table;
use depthcal_calibration::stage_clock::StageTimes;
use depthcal_calibration::task::RigDiagnosisRecords;
use depthcal_calibration::task::diagnosis_record;
use depthcal_report::{ReportInput, ReportRig, Role, rig_sentences};
use pyo3::prelude::*;

use crate::calibrated::Calibration;
use crate::diagnosed::{Diagnosis, Examined};
use crate::effect::Effect;
use crate::failure::{Failure, input};
use crate::request::{checked_folds, json, model_request, register_with};
use crate::rig::{Rig, html, rig_options, shown};
use crate::running::run;
use crate::written::{save_together, write_text};

/// The diagnosis of a rig.
#[pyclass(frozen, module = "depthcal._depthcal")]
pub(crate) struct RigDiagnosis {
    /// Without the cameras' own diagnoses.
    found: Box<Found>,
    records: RigDiagnosisRecords,
    /// The cameras with depth.
    own: Vec<(String, Py<Diagnosis>)>,
    title: String,
    stages: StageTimes,
    call: String,
}

/// Finds what the models of a rig's cameras lack.
#[pyfunction]
#[pyo3(signature = (rig, verify, model, with, effects, lens, folds, discovery, call, progress))]
#[expect(clippy::too_many_arguments, reason = "called by one Python function, which names them")]
pub(crate) fn diagnose_rigs(
    py: Python<'_>,
    rig: &Rig,
    verify: Option<PyRef<'_, Rig>>,
    model: String,
    with: Vec<String>,
    effects: Vec<PyRef<'_, Effect>>,
    lens: Option<String>,
    folds: usize,
    discovery: bool,
    call: String,
    progress: Option<Py<PyAny>>,
) -> PyResult<RigDiagnosis> {
    let folds = checked_folds(folds)?;
    let mut register = register_with(&effects)?;
    let request = model_request(model, with, lens, &mut register)?;
    let loaded = rig.loaded.clone();
    let verify = verify.map(|rig| rig.loaded.clone());
    run(py, progress.as_ref(), move |progress| {
        let rig = rig_options(&request, &register, &loaded, progress)?;
        let options = RigDiagnoseOptions { rig, folds, formulas: discovery, ..RigDiagnoseOptions::default() };
        let mut found = diagnose_rig(&loaded.capture, verify.as_ref().map(|verify| &verify.capture), &options)?;
        let no_cameras = || input("the dataset declares no cameras");
        let mut examined = Vec::new();
        for camera in &found.cameras {
            let index = loaded.capture.cameras.iter().position(|own| own.name == camera.name);
            let index = index.ok_or_else(no_cameras)?;
            let last = &camera.diagnosis.last;
            let stage = progress.stage("evaluation");
            let fitted = evaluate(&last.camera, &last.capture);
            drop(stage);
            let reference = loaded.cameras[index].reference.clone();
            let (record, register) =
                diagnosis_record(&camera.diagnosis, reference, &request.model, &register, progress).map_err(input)?;
            examined.push((index, fitted, record, register));
        }
        let reference = loaded.cameras.first().map(|camera| camera.reference.clone()).ok_or_else(no_cameras)?;
        let own = examined.iter().map(|(_, _, record, _)| record.clone()).collect();
        let records = RigDiagnosisRecords::new(&found, reference, own).ok_or_else(no_cameras)?;
        let stages = progress.stage_times();
        let cameras = std::mem::take(&mut found.cameras).into_iter().zip(examined);
        let own = cameras.map(|(camera, (index, fitted, record, register))| {
            let diagnosis = Diagnosis {
                found: Box::new(camera.diagnosis),
                fitted,
                record,
                register,
                title: format!("{}/{}", loaded.cameras[index].capture.name, camera.name),
                loaded: Examined::OfRig(loaded.clone(), index),
                verified: verify.is_some() && !camera.poses_from_others,
                stages: stages.clone(),
                call: call.clone(),
            };
            Ok((camera.name, Python::attach(|py| Py::new(py, diagnosis)).map_err(input)?))
        });
        let own = own.collect::<Result<Vec<_>, Failure>>()?;
        let title = loaded.dataset.name.clone();
        Ok(RigDiagnosis { found: Box::new(found), records, own, title, stages, call })
    })
}

impl RigDiagnosis {
    fn html(&self) -> Result<String, Failure> {
        let found = &self.found;
        let story = rig_sentences(&self.records.diagnosis);
        let datasets: Vec<_> = [(&found.fitted, Role::Fitted), (&found.after, Role::HeldOut)]
            .into_iter()
            .filter_map(|(rig, role)| shown(rig, role))
            .collect();
        let report = ReportInput {
            title: self.title.clone(),
            command_line: self.call.clone(),
            stages: self.stages.clone(),
            calibrated: found.last.cameras.first().map(|camera| &camera.calibrated),
            evaluations: &datasets,
            diagnosis: None,
            story: &story,
        };
        let evaluated = [&found.fitted, &found.after];
        html(
            &report,
            &ReportRig { cameras: &found.last.placed(), record: &self.records.calibration, evaluated: &evaluated },
        )
    }
}

#[pymethods]
impl RigDiagnosis {
    /// The record as JSON: `diagnosis.json`.
    fn json(&self) -> PyResult<String> {
        json(&self.records.diagnosis)
    }

    /// (camera, its own diagnosis) of every camera with depth.
    fn own(&self, py: Python<'_>) -> Vec<(String, Py<Diagnosis>)> {
        self.own.iter().map(|(name, diagnosis)| (name.clone(), diagnosis.clone_ref(py))).collect()
    }

    /// The last rig.
    fn calibration(&self) -> PyResult<Calibration> {
        Ok(Calibration::of_record(self.records.calibration.clone(), self.found.register.clone())?)
    }

    /// Errors of the last rig as JSON: `evaluation.json`.
    fn evaluation(&self) -> PyResult<String> {
        json(&self.records.evaluation)
    }

    /// The errors on held-out frames as a table of text.
    fn table(&self) -> String {
        table(&self.records.diagnosis.held_out.after.datasets, None)
    }

    /// The report as HTML.
    fn report_html(&self, py: Python<'_>) -> PyResult<String> {
        run(py, None, |_| self.html())
    }

    /// Writes `diagnosis.json`, `calibration.json`, `evaluation.json` and `report.html` into a folder, and the files of every camera's own
    /// diagnosis into a folder of its name; returns the paths.
    fn save(&self, py: Python<'_>, out: PathBuf) -> PyResult<Vec<PathBuf>> {
        run(py, None, |_| {
            save_together(&out, "calibration.json", |out| {
                let mut written = Vec::new();
                for (name, diagnosis) in &self.own {
                    let files = diagnosis.get().write(&out.join(name))?;
                    written.extend(files.into_iter().map(|file| PathBuf::from(name).join(file)));
                }
                self.records.diagnosis.write(out.join("diagnosis.json")).map_err(input)?;
                self.records.calibration.write(out.join("calibration.json")).map_err(input)?;
                self.records.evaluation.write(out.join("evaluation.json")).map_err(input)?;
                write_text(out.join("report.html"), &self.html()?)?;
                let names = ["diagnosis.json", "calibration.json", "evaluation.json", "report.html"];
                written.extend(names.map(PathBuf::from));
                Ok(written)
            })
        })
    }
}
