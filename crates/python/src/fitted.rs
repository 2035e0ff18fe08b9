//! `calibrate`: a dataset, fitted and judged.

use std::path::PathBuf;

use depthcal_calibration::diagnose::effect_scores::effect_scores;
use depthcal_calibration::judge::parts::Parts;
use depthcal_calibration::load::LoadedCamera;
use depthcal_calibration::task::{Fit as Fitted, FitRequest, GivenPrior, Made, NextRequest};
use depthcal_report::{next_value, prior_sentences};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arguments::argument;
use crate::calibrated::Calibration;
use crate::dataset::Dataset;
use crate::failure::input;
use crate::request::{base_options, estimator_of, hold_out_of, json, model_request};
use crate::running::{run, run_in};
use crate::words::Words;
use crate::written::{html, save};

/// A fit with its errors.
#[pyclass(frozen, module = "depthcal._depthcal")]
#[derive(Debug)]
pub(crate) struct Fit {
    fit: Fitted,
    made: Made,
}

/// Fits a dataset and judges the fit. `model` is as for [`model_request`]; `options` are `estimator`, `hold_out`,
/// `cross_validate`, `blocks` and `priors`: camera, name and JSON of a fleet's prior.
#[pyfunction]
pub(crate) fn calibrate(
    py: Python<'_>,
    dataset: &Dataset,
    model: &Bound<'_, PyDict>,
    options: &Bound<'_, PyDict>,
    call: String,
    progress: Option<Py<PyAny>>,
) -> PyResult<Fit> {
    let hold_out: Option<(usize, usize)> = argument(options, "hold_out")?;
    let cross_validate: Option<usize> = argument(options, "cross_validate")?;
    if hold_out.is_some() && cross_validate.is_some() {
        return Err(input("hold_out and cross_validate exclude each other: give one of them").into());
    }
    if cross_validate.is_some_and(|parts| parts < 2) {
        return Err(input("cross_validate is the number of parts: give at least 2").into());
    }
    let hold_out = hold_out_of(hold_out)?;
    let (model, register) = model_request(model)?;
    let read = |(camera, name, text): (Option<String>, String, String)| {
        let prior = serde_json::from_str(&text).map_err(|e| input(format!("{name}: {e}")))?;
        Ok::<_, PyErr>(GivenPrior { camera, name, prior })
    };
    let priors = argument::<Vec<(Option<String>, String, String)>>(options, "priors")?;
    let priors = priors.into_iter().map(read).collect::<Result<Vec<_>, _>>()?;
    let request = FitRequest {
        model,
        estimator: estimator_of(&argument::<String>(options, "estimator")?)?,
        hold_out,
        cross_validate,
        parts: if argument(options, "blocks")? { Parts::Blocks } else { Parts::Interleaved },
        priors,
    };
    let loaded = dataset.loaded.clone();
    run_in(Words::for_dataset(&loaded), py, progress.as_ref(), move |progress| {
        let fit = request.fit(&loaded, base_options(&register, progress))?;
        Ok(Fit { fit, made: Made { command_line: call, stages: progress.stage_times() } })
    })
}

#[pymethods]
impl Fit {
    /// The calibration, of a rig of all cameras.
    fn calibration(&self) -> PyResult<Calibration> {
        Ok(Calibration::of_record(self.fit.record.clone(), self.fit.register.clone())?)
    }

    /// Errors of every dataset as JSON: `evaluation.json`.
    fn evaluation(&self) -> PyResult<String> {
        json(&self.fit.evaluation)
    }

    /// Changes by the prior of a fleet, in sentences.
    fn prior_sentences(&self) -> Vec<String> {
        prior_sentences(&self.fit.fitted.reference().calibrated)
    }

    /// Scores of the effects that a camera's model lacks as JSON, `scores.json`; `None` where none can be scored. The camera is
    /// the only one where none is named.
    fn scores(&self, py: Python<'_>, camera: Option<String>) -> PyResult<Option<String>> {
        let names = || self.fit.loaded.cameras.iter().map(LoadedCamera::name).collect::<Vec<_>>().join(", ");
        let named = |name: &str| self.fit.fitted.cameras.iter().find(|fitted| fitted.name == name);
        let fitted = match &camera {
            None if self.fit.fitted.only_camera().is_some() => self.fit.fitted.cameras.first(),
            None => None,
            Some(name) => named(name),
        };
        let fitted = fitted.ok_or_else(|| input(format!("camera: give one of {}", names())))?;
        let loaded = self.fit.loaded.cameras.iter().find(|loaded| loaded.name() == fitted.name);
        let reference = loaded.map(|loaded| loaded.reference.clone()).unwrap_or_default();
        let scores =
            run(py, None, |_| effect_scores(&fitted.calibrated, &self.fit.register, reference).map_err(input))?;
        scores.as_ref().map(json).transpose()
    }

    /// Captures to add as JSON, as `depthcal next --json` gives them.
    #[pyo3(signature = (goal, range_mm, within, frames, camera))]
    fn next_captures(
        &self,
        py: Python<'_>,
        goal: String,
        range_mm: Option<[f64; 2]>,
        within: Option<f64>,
        frames: usize,
        camera: Option<String>,
    ) -> PyResult<String> {
        let is_range = |[near, far]: [f64; 2]| near > 0.0 && far > near && far.is_finite();
        if range_mm.is_some_and(|range| !is_range(range)) {
            return Err(input("range_mm is nearest and farthest distance in mm, such as (500, 4000)").into());
        }
        if within.is_some_and(|within| !(within.is_finite() && within > 0.0)) {
            return Err(input("within is an error above 0, such as 1.0").into());
        }
        if !(1..=50).contains(&frames) {
            return Err(input("frames is the number of poses: give 1 to 50").into());
        }
        let request = NextRequest { goal, range_mm, within, poses: frames, camera };
        let next = run(py, None, |_| Ok(request.next(&self.fit.fitted)?))?;
        json(&next_value(&next))
    }

    /// The errors as a table of text.
    fn table(&self) -> String {
        self.fit.table()
    }

    /// The report as HTML.
    fn report_html(&self, py: Python<'_>) -> PyResult<String> {
        run(py, None, |_| html(&self.fit, &self.made))
    }

    /// Writes the files of the command line into a folder; returns the paths.
    fn save(&self, py: Python<'_>, out: PathBuf) -> PyResult<Vec<PathBuf>> {
        run(py, None, |_| save(&self.fit, &self.made, &out))
    }
}
