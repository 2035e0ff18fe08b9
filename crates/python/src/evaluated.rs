//! `evaluate`: errors of a calibration on datasets.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use depthcal_calibration::camera_record::cameras_from_record;
use depthcal_calibration::task::{Evaluations, Made, OptionNames, with_effects};
use depthcal_io::Calibration as CalibrationRecord;
use pyo3::prelude::*;

use crate::calibrated::Calibration;
use crate::dataset::Dataset;
use crate::failure::input;
use crate::request::json;
use crate::running::run;
use crate::written::{html, save};

/// Errors of a calibration.
#[pyclass(frozen, module = "depthcal._depthcal")]
#[derive(Debug)]
pub(crate) struct Evaluation {
    evaluations: Evaluations,
    made: Made,
}

/// Measures the errors of a calibration on datasets. `with` are files of formulas with values, which the camera is given in
/// addition.
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
    let record = calibration.record.clone();
    run(py, progress.as_ref(), move |progress| {
        let names = OptionNames::ARGUMENTS;
        let with = depthcal_formula::resolve(names.with, &with, &mut register).map_err(input)?;
        let mut cameras = cameras_from_record(&record, &register).map_err(input)?;
        if let ([camera], false) = (cameras.as_mut_slice(), with.is_empty()) {
            camera.camera = with_effects(camera.camera.clone(), names.with, &with, &register)?;
        } else if !with.is_empty() {
            return Err(input("effects are for one camera: calibrate the rig with the effect CAMERA:EFFECT"));
        }
        let mut evaluations = Evaluations { title, cameras, calibration: Some(record), datasets: Vec::new() };
        for loaded in loaded {
            evaluations.add(&loaded, Path::new(&loaded.name), progress)?;
        }
        Ok(Evaluation { evaluations, made: Made { command_line: call, stages: progress.stage_times() } })
    })
}

#[pymethods]
impl Evaluation {
    /// The record as JSON: `evaluation.json`.
    fn json(&self) -> PyResult<String> {
        json(&self.evaluations.record())
    }

    /// The errors as a table of text.
    fn table(&self) -> String {
        self.evaluations.table()
    }

    /// (dataset, frame, reason) of every frame that could not be evaluated.
    fn dropped(&self) -> Vec<(String, String, String)> {
        let cameras = self.evaluations.datasets.iter().flat_map(|(rig, _)| &rig.cameras);
        let frames = cameras.flat_map(|(_, camera)| camera.dropped.iter().map(move |frame| (camera, frame)));
        frames.map(|(camera, f)| (camera.name.clone(), f.name.clone(), f.reason.clone())).collect()
    }

    /// The report as HTML.
    fn report_html(&self, py: Python<'_>) -> PyResult<String> {
        run(py, None, |_| html(&self.evaluations, &self.made))
    }

    /// Writes `evaluation.json` and `report.html` into a folder; returns the paths.
    fn save(&self, py: Python<'_>, out: PathBuf) -> PyResult<Vec<PathBuf>> {
        run(py, None, |_| {
            let Evaluations { calibration, title, .. } = &self.evaluations;
            CalibrationRecord::check_no_other_in(&out, calibration.as_deref(), title).map_err(input)?;
            save(&self.evaluations, &self.made, &out)
        })
    }
}
