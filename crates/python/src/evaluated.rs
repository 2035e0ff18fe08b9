//! `evaluate`: errors of a calibration on datasets.

use std::path::PathBuf;
use std::sync::Arc;

use depthcal_calibration::judge::evaluate::{Evaluated, evaluate as judge};
use depthcal_calibration::judge::table::table;
use depthcal_calibration::stage_clock::StageTimes;
use depthcal_calibration::task::{OptionNames, with_effects};
use depthcal_io::{Calibration as CalibrationRecord, DatasetEvaluation, Evaluation as Record};
use depthcal_report::{ReportDataset, ReportInput, Role};
use pyo3::prelude::*;

use crate::calibrated::Calibration;
use crate::dataset::Dataset;
use crate::failure::{Failure, input};
use crate::request::json;
use crate::running::run;
use crate::written::{html, save_together, write_report};

/// Errors of a calibration.
#[pyclass(frozen, module = "depthcal._depthcal")]
#[derive(Debug)]
pub(crate) struct Evaluation {
    evaluated: Vec<(Evaluated, Role)>,
    record: Arc<CalibrationRecord>,
    title: String,
    stages: StageTimes,
    call: String,
}

/// Measures the errors of a calibration on datasets. `with` are files of formulas with values, which the camera is given in addition.
#[pyfunction]
#[pyo3(signature = (calibration, datasets, with, title, call, progress))]
pub(crate) fn evaluate(
    py: Python<'_>,
    calibration: &Calibration,
    datasets: Vec<PyRef<'_, Dataset>>,
    with: Vec<String>,
    title: String,
    call: String,
    progress: Option<Py<PyAny>>,
) -> PyResult<Evaluation> {
    let mut register = calibration.register.clone();
    let loaded: Vec<_> = datasets.iter().map(|dataset| Arc::clone(&dataset.loaded)).collect();
    let (record, camera) = (calibration.record.clone(), calibration.camera.clone());
    run(py, progress.as_ref(), move |progress| {
        let names = OptionNames::ARGUMENTS;
        let with = depthcal_formula::resolve(names.with, &with, &mut register).map_err(input)?;
        let camera = with_effects((*camera).clone(), names.with, &with, &register)?;
        let mut evaluated = Vec::new();
        for loaded in loaded {
            let capture = &loaded.capture;
            let (found, size) = ((capture.width, capture.height), (camera.width, camera.height));
            if found != size {
                return Err(input(format!(
                    "{}: its images are {} × {} px, but the calibration is for {} × {} px",
                    capture.name, found.0, found.1, size.0, size.1
                )));
            }
            let is_own = record.dataset.digest == loaded.reference.digest;
            let _stage = progress.stage("evaluation");
            evaluated.push((judge(&camera, capture), if is_own { Role::Fitted } else { Role::Other }));
        }
        Ok(Evaluation { evaluated, record, title, stages: progress.stage_times(), call })
    })
}

impl Evaluation {
    fn records(&self) -> Vec<DatasetEvaluation> {
        self.evaluated.iter().map(|(evaluated, _)| evaluated.record()).collect()
    }

    fn report<T>(&self, make: impl FnOnce(&ReportInput<'_>) -> Result<T, Failure>) -> Result<T, Failure> {
        let shown: Vec<_> =
            self.evaluated.iter().map(|(evaluated, role)| ReportDataset { evaluated, role: *role }).collect();
        make(&ReportInput {
            title: format!("Evaluation of {}", self.title),
            command_line: self.call.clone(),
            stages: self.stages.clone(),
            evaluations: &shown,
            ..ReportInput::default()
        })
    }
}

#[pymethods]
impl Evaluation {
    /// The record as JSON: `evaluation.json`.
    fn json(&self) -> PyResult<String> {
        json(&Record { datasets: self.records(), ..Record::default() })
    }

    /// The errors as a table of text.
    fn table(&self) -> String {
        let fitted = self.evaluated.iter().find(|(_, role)| *role == Role::Fitted);
        table(&self.records(), fitted.map(|(evaluated, _)| evaluated.name.as_str()))
    }

    /// (dataset, frame, reason) of every frame that could not be evaluated.
    fn dropped(&self) -> Vec<(String, String, String)> {
        let of = |e: &Evaluated| {
            let reasons = e.dropped.iter().map(|d| (e.name.clone(), d.name.clone(), d.reason.clone()));
            reasons.collect::<Vec<_>>()
        };
        self.evaluated.iter().flat_map(|(evaluated, _)| of(evaluated)).collect()
    }

    /// The report as HTML.
    fn report_html(&self, py: Python<'_>) -> PyResult<String> {
        run(py, None, |_| self.report(html))
    }

    /// Writes `evaluation.json` and `report.html` into a folder; returns the paths.
    fn save(&self, py: Python<'_>, out: PathBuf) -> PyResult<Vec<PathBuf>> {
        run(py, None, |_| {
            CalibrationRecord::check_no_other_in(&out, Some(&self.record), &self.title).map_err(input)?;
            save_together(&out, "evaluation.json", |out| {
                let record = Record { datasets: self.records(), ..Record::default() };
                record.write(out.join("evaluation.json")).map_err(input)?;
                self.report(|report| write_report(report, out))?;
                Ok(["evaluation.json", "report.html"].map(PathBuf::from).to_vec())
            })
        })
    }
}
