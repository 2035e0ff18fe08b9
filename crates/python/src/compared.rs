//! `compare`: depth models on data that their fits did not use.

use std::path::PathBuf;

use depthcal_calibration::compare::tables::tables;
use depthcal_calibration::task::{CompareRequest, Compared, Made};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arguments::argument;
use crate::dataset::Dataset;
use crate::failure::{Failure, input};
use crate::request::{base_options, json, model_request};
use crate::running::run;
use crate::written::{html, save};

/// A comparison of depth models.
#[pyclass(frozen, module = "depthcal._depthcal")]
#[derive(Debug)]
pub(crate) struct Comparison {
    compared: Compared,
    made: Made,
}

/// Fits depth models to `train` and compares them on `verify`, or by cross-validation. `model` is as for [`model_request`], of
/// which the depth model is not used; `options` are `models`, `folds`, `thesis` and `learning`.
#[pyfunction]
pub(crate) fn compare(
    py: Python<'_>,
    train: &Dataset,
    verify: Vec<PyRef<'_, Dataset>>,
    model: &Bound<'_, PyDict>,
    options: &Bound<'_, PyDict>,
    call: String,
    progress: Option<Py<PyAny>>,
) -> PyResult<Comparison> {
    let (model, mut register) = model_request(model)?;
    let models: Vec<String> = argument(options, "models")?;
    let resolved = models.iter().map(|text| depthcal_formula::resolve_model("models", text, &mut register));
    let models = resolved.collect::<Result<Vec<_>, _>>().map_err(input)?;
    let specs = models.iter().map(|text| register.model_spec(text).map_err(|e| input(format!("models {text}: {e}"))));
    let models = specs.collect::<Result<Vec<_>, Failure>>()?;
    let request = CompareRequest {
        model,
        models,
        folds: argument(options, "folds")?,
        thesis: argument(options, "thesis")?,
        learning_fits: argument(options, "learning")?,
    };
    let train = train.loaded.clone();
    train.only_camera().map_err(input)?;
    let verify: Vec<_> = verify.iter().map(|dataset| dataset.loaded.clone()).collect();
    run(py, progress.as_ref(), move |progress| {
        let mut compared = request.compare(&train, &verify, base_options(&register, progress))?;
        let compared = compared.pop().ok_or_else(|| input("there is no camera to compare models on"))?;
        if compared.is_untrusted() {
            return Err(Failure::Untrusted(compared.record.verdict.join(" ")));
        }
        Ok(Comparison { compared, made: Made { command_line: call, stages: progress.stage_times() } })
    })
}

#[pymethods]
impl Comparison {
    /// The record as JSON: `comparison.json`.
    fn json(&self) -> PyResult<String> {
        json(&self.compared.record)
    }

    /// (title, text) of every table.
    fn tables(&self) -> Vec<(String, String)> {
        tables(&self.compared.record).into_iter().map(|table| (table.title.to_string(), table.text)).collect()
    }

    /// The report as HTML.
    fn report_html(&self, py: Python<'_>) -> PyResult<String> {
        run(py, None, |_| html(&self.compared, &self.made))
    }

    /// Writes `comparison.json` and `report.html` into a folder; returns the paths.
    fn save(&self, py: Python<'_>, out: PathBuf) -> PyResult<Vec<PathBuf>> {
        run(py, None, |_| save(&self.compared, &self.made, &out))
    }
}
