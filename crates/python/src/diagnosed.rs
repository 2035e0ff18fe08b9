//! `diagnose`: effects that the models of a dataset's cameras lack.

use std::path::PathBuf;
use std::sync::Arc;

use depthcal_calibration::diagnose::effect_scores::effect_scores;
use depthcal_calibration::judge::table::table;
use depthcal_calibration::task::{DiagnoseRequest, Diagnosed, DiagnosedCamera, Made, Results};
use depthcal_report::{Detail, diagnosis_text, verdict_sentence};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arguments::argument;
use crate::calibrated::Calibration;
use crate::dataset::Dataset;
use crate::effect::Effect;
use crate::failure::{Failure, input};
use crate::request::{base_options, checked_folds, json, model_request};
use crate::running::{run, run_in};
use crate::words::Words;
use crate::written::{html, save};

/// The diagnosis of a dataset, or of one of its cameras.
#[pyclass(frozen, module = "depthcal._depthcal")]
pub(crate) struct Diagnosis {
    diagnosed: Arc<Diagnosed>,
    /// The camera by its number; `None` for all.
    camera: Option<usize>,
    made: Made,
}

/// Finds effects that the models of a dataset's cameras lack. `model` is as for [`model_request`]; `options` are `folds` and
/// `discovery`.
#[pyfunction]
pub(crate) fn diagnose(
    py: Python<'_>,
    dataset: &Dataset,
    verify: Option<PyRef<'_, Dataset>>,
    model: &Bound<'_, PyDict>,
    options: &Bound<'_, PyDict>,
    call: String,
    progress: Option<Py<PyAny>>,
) -> PyResult<Diagnosis> {
    let folds = checked_folds(argument(options, "folds")?)?;
    let (model, register) = model_request(model)?;
    let request = DiagnoseRequest { model, folds, formulas: argument(options, "discovery")? };
    let loaded = dataset.loaded.clone();
    let verify = verify.map(|dataset| dataset.loaded.clone());
    run_in(Words::for_dataset(&loaded), py, progress.as_ref(), move |progress| {
        let diagnosed = request.diagnose(&loaded, verify.as_deref(), base_options(&register, progress))?;
        let made = Made { command_line: call, stages: progress.stage_times() };
        Ok(Diagnosis { diagnosed: Arc::new(diagnosed), camera: None, made })
    })
}

impl Diagnosis {
    /// The camera, where this is of one.
    fn only_camera(&self) -> Option<&DiagnosedCamera> {
        match self.camera {
            Some(number) => self.diagnosed.cameras.get(number).map(|(_, camera)| camera),
            None => self.diagnosed.only_camera(),
        }
    }

    fn results(&self) -> &dyn Results {
        match self.only_camera() {
            Some(camera) => camera,
            None => &*self.diagnosed,
        }
    }
}

#[pymethods]
impl Diagnosis {
    /// The record as JSON: `diagnosis.json`.
    fn json(&self) -> PyResult<String> {
        match self.only_camera() {
            Some(camera) => json(&camera.record),
            None => json(&self.diagnosed.record),
        }
    }

    /// Names of the cameras with depth.
    fn cameras(&self) -> Vec<String> {
        self.diagnosed.cameras.iter().map(|(name, _)| name.clone()).collect()
    }

    /// The diagnosis of one camera.
    fn camera(&self, name: &str) -> PyResult<Self> {
        let number = self.diagnosed.cameras.iter().position(|(camera, _)| camera == name);
        let unknown = || input(format!("no camera '{name}' was examined; these were: {}", self.cameras().join(", ")));
        let camera = Some(number.ok_or_else(unknown)?);
        Ok(Self { diagnosed: self.diagnosed.clone(), camera, made: self.made.clone() })
    }

    /// The diagnosis in words.
    fn text(&self) -> String {
        if let Some(camera) = self.only_camera() {
            return diagnosis_text(&camera.record, &camera.register, Detail::All);
        }
        let sentence =
            |(name, camera): &(String, DiagnosedCamera)| format!("[{name}] {}", verdict_sentence(&camera.record));
        let mut lines: Vec<String> = self.diagnosed.cameras.iter().map(sentence).collect();
        if let Some(rig) = &self.diagnosed.record.rig {
            lines.push("held-out frames, with what was added:".to_owned());
            lines.push(table(&rig.held_out.after.datasets, None));
        }
        lines.join("\n")
    }

    /// The verdict in a sentence, of several cameras in one for each.
    fn sentence(&self) -> String {
        match self.only_camera() {
            Some(camera) => verdict_sentence(&camera.record),
            None => {
                let cameras = self.diagnosed.cameras.iter();
                cameras
                    .map(|(name, c)| format!("{name}: {}.", verdict_sentence(&c.record)))
                    .collect::<Vec<_>>()
                    .join(" ")
            }
        }
    }

    /// The calibration of the last model, of a rig of all cameras.
    fn calibration(&self) -> PyResult<Calibration> {
        let lacking = || input("no camera was examined");
        Ok(match (self.only_camera(), &self.diagnosed.rig) {
            (Some(camera), _) => Calibration::of_record(camera.calibration(), camera.register.clone())?,
            (None, Some(rig)) => Calibration::of_record(rig.calibration.clone(), self.diagnosed.register.clone())?,
            (None, None) => return Err(lacking().into()),
        })
    }

    /// The formulas that were found, as effects.
    fn formulas(&self) -> Vec<Effect> {
        let cameras =
            self.only_camera().map_or_else(|| self.diagnosed.cameras.iter().map(|(_, c)| c).collect(), |c| vec![c]);
        let formulas = cameras.into_iter().flat_map(|camera| &camera.diagnosis.formulas);
        formulas.map(|formula| Effect::of_formula(formula.effect.clone())).collect()
    }

    /// Errors of the last model as JSON: `evaluation.json`.
    fn evaluation(&self) -> PyResult<String> {
        match self.only_camera() {
            Some(camera) => json(&camera.evaluation()),
            None => json(&self.diagnosed.evaluation()),
        }
    }

    /// Scores of the effects that one camera's last model lacks as JSON, `scores.json`; `None` where none can be scored.
    fn scores(&self, py: Python<'_>) -> PyResult<Option<String>> {
        let several = || input(format!("the diagnosis is of several cameras, {}: take one", self.cameras().join(", ")));
        let camera = self.only_camera().ok_or_else(several)?;
        let reference = camera.loaded_camera().reference.clone();
        let scores =
            run(py, None, |_| effect_scores(&camera.diagnosis.last, &camera.register, reference).map_err(input))?;
        scores.as_ref().map(json).transpose()
    }

    /// The report as HTML.
    fn report_html(&self, py: Python<'_>) -> PyResult<String> {
        run(py, None, |_| html(self.results(), &self.made))
    }

    /// Writes the files of the command line into a folder; returns the paths.
    fn save(&self, py: Python<'_>, out: PathBuf) -> PyResult<Vec<PathBuf>> {
        run(py, None, |_| -> Result<_, Failure> { save(self.results(), &self.made, &out) })
    }
}
