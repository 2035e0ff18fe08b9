//! `compare`: depth models on data that their fits did not use.

use std::path::PathBuf;
use std::sync::Arc;

use depthcal_calibration::compare::tables::tables;
use depthcal_calibration::task::{CompareRequest, Compared, Made};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arguments::argument;
use crate::dataset::Dataset;
use crate::failure::{Failure, input};
use crate::request::{base_options, json, model_request};
use crate::running::{run, run_in};
use crate::words::Words;
use crate::written::{html, save};

/// A comparison of depth models, on every camera of a dataset that has depth.
#[pyclass(frozen, module = "depthcal._depthcal")]
#[derive(Debug)]
pub(crate) struct Comparison {
    compared: Arc<Vec<Compared>>,
    /// The camera by its number; `None` for all of a dataset of several.
    camera: Option<usize>,
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
    if request.models.is_empty() {
        return Err(input("models is empty: give at least one depth model, such as \"projective\"").into());
    }
    let train = train.loaded.clone();
    let verify: Vec<_> = verify.iter().map(|dataset| dataset.loaded.clone()).collect();
    run_in(Words::for_dataset(&train), py, progress.as_ref(), move |progress| {
        let compared = request.compare(&train, &verify, base_options(&register, progress))?;
        if let Some(untrusted) = compared.iter().find(|compared| compared.is_untrusted()) {
            return Err(Failure::Untrusted(untrusted.record.verdict.join(" ")));
        }
        let camera = (train.cameras.len() == 1).then_some(0);
        let made = Made { command_line: call, stages: progress.stage_times() };
        Ok(Comparison { compared: Arc::new(compared), camera, made })
    })
}

impl Comparison {
    /// The comparison of one camera.
    fn one(&self) -> Result<&Compared, Failure> {
        let several =
            || input(format!("the comparison is of several cameras: take one of {}", self.cameras().join(", ")));
        self.camera.and_then(|number| self.compared.get(number)).ok_or_else(several)
    }
}

#[pymethods]
impl Comparison {
    /// Names of the cameras that were compared.
    fn cameras(&self) -> Vec<&str> {
        self.compared.iter().map(|compared| compared.camera.as_str()).collect()
    }

    /// Whether this is the comparison on one camera.
    fn is_of_one(&self) -> bool {
        self.camera.is_some()
    }

    /// The comparison of one camera.
    fn camera(&self, name: &str) -> PyResult<Self> {
        let number = self.compared.iter().position(|compared| compared.camera == name);
        let unknown = || input(format!("no camera '{name}' was compared; these were: {}", self.cameras().join(", ")));
        let camera = Some(number.ok_or_else(unknown)?);
        Ok(Self { compared: self.compared.clone(), camera, made: self.made.clone() })
    }

    /// The record as JSON: `comparison.json`.
    fn json(&self) -> PyResult<String> {
        json(&self.one()?.record)
    }

    /// (title, text) of every table.
    fn tables(&self) -> PyResult<Vec<(String, String)>> {
        Ok(tables(&self.one()?.record).into_iter().map(|table| (table.title.to_string(), table.text)).collect())
    }

    /// The report as HTML.
    fn report_html(&self, py: Python<'_>) -> PyResult<String> {
        run(py, None, |_| html(self.one()?, &self.made))
    }

    /// Writes `comparison.json` and `report.html` into a folder, of several cameras into a folder for each; returns the paths.
    fn save(&self, py: Python<'_>, out: PathBuf) -> PyResult<Vec<PathBuf>> {
        run(py, None, |_| {
            if self.camera.is_some() {
                return save(self.one()?, &self.made, &out);
            }
            let of_camera = |compared: &Compared| save(compared, &self.made, &out.join(&compared.camera));
            Ok(self.compared.iter().map(of_camera).collect::<Result<Vec<_>, _>>()?.concat())
        })
    }
}
