//! `calibrate`: a dataset, fitted and judged.

use std::path::PathBuf;
use std::sync::Arc;

use depthcal_calibration::calibration_record::calibration_record;
use depthcal_calibration::judge::parts::Parts;
use depthcal_calibration::judge::table::table;
use depthcal_calibration::load::Loaded;
use depthcal_calibration::stage_clock::StageTimes;
use depthcal_calibration::task::{DatasetFit, FitRequest, JudgedFit, prior_for, write_calibration};
use depthcal_io::{Evaluation, Prior};
use depthcal_model::Register;
use depthcal_report::{ReportDataset, ReportInput, Role, fit_sentences, prior_sentences};
use pyo3::prelude::*;

use crate::calibrated::Calibration;
use crate::dataset::Dataset;
use crate::effect::Effect;
use crate::failure::{Failure, input};
use crate::request::{base_options, estimator_of, hold_out_of, json, model_request, register_with};
use crate::running::run;
use crate::written::{html, save_together, write_report};

/// A fit with its errors.
#[pyclass(frozen, module = "depthcal._depthcal")]
#[derive(Debug)]
pub(crate) struct Fit {
    fit: DatasetFit,
    judged: JudgedFit,
    loaded: Arc<Loaded>,
    register: Register,
    stages: StageTimes,
    call: String,
}

/// Fits a dataset and judges the fit.
#[pyfunction]
#[pyo3(signature = (dataset, model, with, effects, lens, estimator, hold_out, cross_validate, blocks, prior, call, progress))]
#[expect(clippy::too_many_arguments, reason = "called by one Python function, which names them")]
pub(crate) fn calibrate(
    py: Python<'_>,
    dataset: &Dataset,
    model: String,
    with: Vec<String>,
    effects: Vec<PyRef<'_, Effect>>,
    lens: Option<String>,
    estimator: &str,
    hold_out: Option<(usize, usize)>,
    cross_validate: Option<usize>,
    blocks: bool,
    prior: Option<(String, String)>,
    call: String,
    progress: Option<Py<PyAny>>,
) -> PyResult<Fit> {
    if hold_out.is_some() && cross_validate.is_some() {
        return Err(input("hold_out and cross_validate exclude each other: give one of them").into());
    }
    if cross_validate.is_some_and(|parts| parts < 2) {
        return Err(input("cross_validate is the number of parts: give at least 2").into());
    }
    let hold_out = hold_out_of(hold_out)?;
    let mut register = register_with(&effects)?;
    let request = FitRequest {
        model: model_request(model, with, lens, &mut register)?,
        estimator: estimator_of(estimator)?,
        hold_out,
        cross_validate,
        parts: if blocks { Parts::Blocks } else { Parts::Interleaved },
    };
    let loaded = dataset.loaded.clone();
    let prior: Option<(String, Prior)> = match prior {
        None => None,
        Some((name, text)) => {
            let prior = serde_json::from_str(&text).map_err(|e| input(format!("{name}: {e}")))?;
            Some((name, prior))
        }
    };
    run(py, progress.as_ref(), move |progress| {
        let mut options = request.options(base_options(&register, progress))?;
        let size = [loaded.capture.width, loaded.capture.height];
        let prior = prior.map(|(name, prior)| prior_for(&name, &prior, size)).transpose()?;
        options.prior = prior.map(Arc::new);
        let fit = request.prepare(&loaded, options)?.fit()?;
        let judged = fit.judge()?;
        Ok(Fit { fit, judged, loaded, register, stages: progress.stage_times(), call })
    })
}

impl Fit {
    fn report<T>(&self, make: impl FnOnce(&ReportInput<'_>) -> Result<T, Failure>) -> Result<T, Failure> {
        let mut shown = vec![ReportDataset { evaluated: &self.judged.fitted, role: Role::Fitted }];
        let held_out = self.judged.held_out.as_ref();
        shown.extend(held_out.map(|(_, evaluated)| ReportDataset { evaluated, role: Role::HeldOut }));
        let story = fit_sentences(&self.fit.result);
        make(&ReportInput {
            title: self.fit.result.capture.name.clone(),
            command_line: self.call.clone(),
            stages: self.stages.clone(),
            calibrated: Some(&self.fit.result),
            evaluations: &shown,
            diagnosis: None,
            story: &story,
        })
    }
}

#[pymethods]
impl Fit {
    /// The calibration.
    fn calibration(&self) -> Calibration {
        let reference = self.loaded.reference.clone();
        let record = calibration_record(&self.fit.result, &self.judged.fitted, reference, None);
        Calibration::new(record, self.fit.result.camera.clone(), self.register.clone())
    }

    /// Errors of every dataset as JSON: `evaluation.json`.
    fn evaluation(&self) -> PyResult<String> {
        json(&Evaluation { datasets: self.judged.records(), ..Evaluation::default() })
    }

    /// What the prior of a fleet did, in sentences.
    fn prior_sentences(&self) -> Vec<String> {
        prior_sentences(&self.fit.result)
    }

    /// The errors as a table of text.
    fn table(&self) -> String {
        table(&self.judged.records(), Some(&self.fit.result.capture.name))
    }

    /// The report as HTML.
    fn report_html(&self, py: Python<'_>) -> PyResult<String> {
        run(py, None, |_| self.report(html))
    }

    /// Writes `observations.json`, `calibration.json`, `evaluation.json` and `report.html` into a folder; returns the paths.
    fn save(&self, py: Python<'_>, out: PathBuf) -> PyResult<Vec<PathBuf>> {
        run(py, None, |_| {
            let (result, fitted) = (&self.fit.result, &self.judged.fitted);
            save_together(&out, "calibration.json", |out| {
                let datasets = self.judged.records();
                write_calibration(result, fitted, &self.loaded, datasets, &self.register, out).map_err(input)?;
                self.report(|report| write_report(report, out))?;
                Ok(["calibration.json", "evaluation.json", "observations.json", "report.html"]
                    .map(PathBuf::from)
                    .to_vec())
            })
        })
    }
}
