//! `compare`: depth models on data that their fits did not use.

use std::path::PathBuf;
use std::sync::Arc;

use depthcal_calibration::calibrate::{CalibrateOptions, Calibrated, calibrate};
use depthcal_calibration::compare::tables::tables;
use depthcal_calibration::compare::{CompareOptions, compare as compare_models};
use depthcal_calibration::stage_clock::StageTimes;
use depthcal_io::Comparison as Record;
use depthcal_report::render_comparison;
use pyo3::prelude::*;

use crate::dataset::Dataset;
use crate::effect::Effect;
use crate::failure::{Failure, input};
use crate::request::{base_options, json, model_request, register_with};
use crate::running::run;
use crate::written::{save_together, write_text};

/// A comparison of depth models.
#[pyclass(frozen, module = "depthcal._depthcal")]
#[derive(Debug)]
pub(crate) struct Comparison {
    record: Record,
    best: Option<Calibrated>,
    stages: StageTimes,
    call: String,
}

/// Fits depth models to `train` and compares them on `verify`, or by cross-validation.
#[pyfunction]
#[pyo3(signature = (train, verify, models, with, effects, lens, folds, thesis, learning, call, progress))]
#[expect(clippy::too_many_arguments, reason = "called by one Python function, which names them")]
pub(crate) fn compare(
    py: Python<'_>,
    train: &Dataset,
    verify: Vec<PyRef<'_, Dataset>>,
    models: Vec<String>,
    with: Vec<String>,
    effects: Vec<PyRef<'_, Effect>>,
    lens: Option<String>,
    folds: usize,
    thesis: bool,
    learning: usize,
    call: String,
    progress: Option<Py<PyAny>>,
) -> PyResult<Comparison> {
    let mut register = register_with(&effects)?;
    let request = model_request("projective".to_owned(), with, lens, &mut register)?;
    let resolved = models.iter().map(|text| depthcal_formula::resolve_model("models", text, &mut register));
    let models = resolved.collect::<Result<Vec<_>, _>>().map_err(input)?;
    let specs = models.iter().map(|text| register.model_spec(text).map_err(|e| input(format!("models {text}: {e}"))));
    let models = specs.collect::<Result<Vec<_>, Failure>>()?;
    let train = train.loaded.clone();
    let verify: Vec<_> = verify.iter().map(|dataset| Arc::clone(&dataset.loaded)).collect();
    for loaded in std::iter::once(&train).chain(&verify) {
        if !loaded.capture.has_depth() {
            let name = &loaded.capture.name;
            return Err(input(format!("the dataset '{name}' has no depth images: nothing to compare")).into());
        }
    }
    let frames = train.capture.frames.len();
    if folds < 2 || (verify.is_empty() && frames < folds) {
        let remedy = "give fewer folds, but at least 2, or verify";
        return Err(input(format!(
            "folds {folds} needs as many frames, but the board was found in {frames}: {remedy}"
        ))
        .into());
    }
    run(py, progress.as_ref(), move |progress| {
        let base = request.for_dataset(request.options(base_options(&register, progress))?, &train)?;
        let options = CompareOptions {
            models,
            calibrate: base,
            folds,
            thesis,
            learning_fits: learning,
            ..CompareOptions::default()
        };
        let captures: Vec<_> = verify.iter().map(|loaded| loaded.capture.clone()).collect();
        let record = compare_models(&train.capture, &captures, &options).map_err(input)?;
        // Fitted again for its maps in the report: the comparison keeps no cameras.
        let _stage = progress.stage("fitting the best model");
        let best = record.models.first().filter(|model| model.failed.is_none()).and_then(|best| {
            let model = register.model_spec(&best.model).ok()?;
            calibrate(&train.capture, &CalibrateOptions { model, ..options.calibrate.clone() }).ok()
        });
        if record.models.iter().all(|model| model.failed.is_some()) {
            return Err(Failure::Untrusted(record.verdict.join(" ")));
        }
        Ok(Comparison { record, best, stages: progress.stage_times(), call })
    })
}

impl Comparison {
    fn html(&self) -> Result<String, Failure> {
        let tables = tables(&self.record);
        render_comparison(&self.record, &tables, self.best.as_ref(), &self.call, &self.stages).map_err(input)
    }
}

#[pymethods]
impl Comparison {
    /// The record as JSON: `comparison.json`.
    fn json(&self) -> PyResult<String> {
        json(&self.record)
    }

    /// (title, text) of every table.
    fn tables(&self) -> Vec<(String, String)> {
        tables(&self.record).into_iter().map(|table| (table.title.to_string(), table.text)).collect()
    }

    /// The report as HTML.
    fn report_html(&self, py: Python<'_>) -> PyResult<String> {
        run(py, None, |_| self.html())
    }

    /// Writes `comparison.json` and `report.html` into a folder; returns the paths.
    fn save(&self, py: Python<'_>, out: PathBuf) -> PyResult<Vec<PathBuf>> {
        run(py, None, |_| {
            save_together(&out, "comparison.json", |out| {
                self.record.write(out.join("comparison.json")).map_err(input)?;
                write_text(out.join("report.html"), &self.html()?)?;
                Ok(["comparison.json", "report.html"].map(PathBuf::from).to_vec())
            })
        })
    }
}
