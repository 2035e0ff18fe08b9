//! Rigs: several cameras on one body, read, calibrated and evaluated together.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use depthcal_calibration::calibrate::rig::RigOptions;
use depthcal_calibration::judge::rig::{EvaluatedRig, evaluate_rig};
use depthcal_calibration::judge::table::table;
use depthcal_calibration::load::LoadedRig;
use depthcal_calibration::load::{LoadOptions, default_cache};
use depthcal_calibration::observe::PlacedCamera;
use depthcal_calibration::progress::ProgressHandle;
use depthcal_calibration::rig_record::cameras_from_record;
use depthcal_calibration::stage_clock::StageTimes;
use depthcal_calibration::task::rig::{RigFit as Fitted, add_effects, evaluation_of, fit, missing_cameras};
use depthcal_calibration::task::{HoldOut, ModelRequest, OptionNames};
use depthcal_io::Calibration as Record;
use depthcal_model::Register;
use depthcal_report::{ReportDataset, ReportInput, ReportRig, Role, render_rig};
use pyo3::prelude::*;

use crate::calibrated::Calibration;
use crate::effect::Effect;
use crate::failure::{Failure, input};
use crate::request::{base_options, hold_out_of, json, model_request, register_with};
use crate::running::run;
use crate::written::{save_together, write_text};

/// A dataset of several cameras with its markers.
#[pyclass(frozen, module = "depthcal._depthcal")]
#[derive(Debug)]
pub(crate) struct Rig {
    pub(crate) loaded: Arc<LoadedRig>,
    path: PathBuf,
}

/// Reads the dataset of a rig in a folder.
#[pyfunction]
#[pyo3(signature = (path, cache, refresh, image_memory_mib, progress))]
pub(crate) fn load_rig(
    py: Python<'_>,
    path: PathBuf,
    cache: bool,
    refresh: bool,
    image_memory_mib: usize,
    progress: Option<Py<PyAny>>,
) -> PyResult<Rig> {
    let folder = path.clone();
    let loaded = run(py, progress.as_ref(), move |progress| {
        let options = LoadOptions {
            cache: if cache { default_cache() } else { None },
            refresh,
            markers: None,
            register: Register::builtin(),
            image_memory: image_memory_mib << 20,
            progress: progress.clone(),
        };
        depthcal_calibration::load::load_rig(&folder, &options).map_err(input)
    })?;
    Ok(Rig { loaded: Arc::new(loaded), path })
}

#[pymethods]
impl Rig {
    #[getter]
    fn name(&self) -> &str {
        &self.loaded.dataset.name
    }

    #[getter]
    fn path(&self) -> &Path {
        &self.path
    }

    /// (camera, frame, number of markers, whether it has depth) of every frame of every camera.
    fn frames(&self) -> Vec<(String, String, usize, bool)> {
        let cameras = self.loaded.capture.cameras.iter();
        let of = cameras.flat_map(|camera| camera.capture.frames.iter().map(|frame| (camera.name.clone(), frame)));
        of.map(|(camera, f)| (camera, f.name.clone(), f.markers.len(), f.has_depth())).collect()
    }

    /// (camera, frame, reason) of every frame that is not used.
    fn dropped(&self) -> Vec<(String, String, String)> {
        let cameras = self.loaded.capture.cameras.iter();
        let of = cameras.flat_map(|camera| camera.capture.dropped.iter().map(|frame| (camera.name.clone(), frame)));
        of.map(|(camera, f)| (camera, f.name.clone(), f.reason.clone())).collect()
    }

    /// Names of the cameras; the first is the reference.
    fn cameras(&self) -> Vec<String> {
        self.loaded.capture.cameras.iter().map(|camera| camera.name.clone()).collect()
    }
}

/// What is asked for, in the terms of a rig.
pub(crate) fn rig_options(
    request: &ModelRequest,
    register: &Register,
    rig: &LoadedRig,
    progress: &ProgressHandle,
) -> Result<RigOptions, Failure> {
    let each = base_options(register, progress);
    let mut options = RigOptions { each, lens: request.lens.clone(), ..RigOptions::default() };
    let text = &request.model;
    options.each.model =
        register.model_spec(text).map_err(|e| input(format!("{} {text}: {e}", request.names.model)))?;
    add_effects(OptionNames::ARGUMENTS.with, &request.with, rig, &mut options)?;
    Ok(options)
}

/// A report of a rig as HTML.
pub(crate) fn html(report: &ReportInput<'_>, rig: &ReportRig<'_>) -> Result<String, Failure> {
    render_rig(report, rig).map_err(input)
}

/// The reference's errors on a dataset, for the sections of a report on one camera.
pub(crate) fn shown(rig: &EvaluatedRig, role: Role) -> Option<ReportDataset<'_>> {
    rig.cameras.first().map(|evaluated| ReportDataset { evaluated, role })
}

/// A rig, fitted and judged.
#[pyclass(frozen, module = "depthcal._depthcal")]
#[derive(Debug)]
pub(crate) struct RigFit {
    fit: Fitted,
    register: Register,
    stages: StageTimes,
    call: String,
}

/// Fits a rig and judges the fit.
#[pyfunction]
#[pyo3(signature = (rig, model, with, effects, lens, hold_out, call, progress))]
#[expect(clippy::too_many_arguments, reason = "called by one Python function, which names them")]
pub(crate) fn calibrate_rig(
    py: Python<'_>,
    rig: &Rig,
    model: String,
    with: Vec<String>,
    effects: Vec<PyRef<'_, Effect>>,
    lens: Option<String>,
    hold_out: Option<(usize, usize)>,
    call: String,
    progress: Option<Py<PyAny>>,
) -> PyResult<RigFit> {
    let hold_out: Option<HoldOut> = hold_out_of(hold_out)?;
    let mut register = register_with(&effects)?;
    let request = model_request(model, with, lens, &mut register)?;
    let loaded = rig.loaded.clone();
    run(py, progress.as_ref(), move |progress| {
        let options = rig_options(&request, &register, &loaded, progress)?;
        let fit = fit(&loaded, &options, hold_out)?;
        Ok(RigFit { fit, register, stages: progress.stage_times(), call })
    })
}

impl RigFit {
    fn html(&self) -> Result<String, Failure> {
        let fit = &self.fit;
        let held_out = fit.held_out.as_ref();
        let datasets: Vec<_> = shown(&fit.fitted, Role::Fitted)
            .into_iter()
            .chain(held_out.and_then(|rig| shown(rig, Role::HeldOut)))
            .collect();
        let report = ReportInput {
            title: fit.result.name.clone(),
            command_line: self.call.clone(),
            stages: self.stages.clone(),
            calibrated: fit.result.cameras.first().map(|camera| &camera.calibrated),
            evaluations: &datasets,
            ..ReportInput::default()
        };
        let evaluated: Vec<_> = std::iter::once(&fit.fitted).chain(held_out).collect();
        html(&report, &ReportRig { cameras: &fit.placed, record: &fit.record, evaluated: &evaluated })
    }
}

#[pymethods]
impl RigFit {
    /// The calibration of all cameras.
    fn calibration(&self) -> PyResult<Calibration> {
        Ok(Calibration::of_record(self.fit.record.clone(), self.register.clone())?)
    }

    /// Errors of every camera as JSON: `evaluation.json`.
    fn evaluation(&self) -> PyResult<String> {
        json(&self.fit.evaluation)
    }

    /// The errors as a table of text.
    fn table(&self) -> String {
        table(&self.fit.evaluation.datasets, None)
    }

    /// The report as HTML.
    fn report_html(&self, py: Python<'_>) -> PyResult<String> {
        run(py, None, |_| self.html())
    }

    /// Writes `calibration.json`, `evaluation.json` and `report.html` into a folder; returns the paths.
    fn save(&self, py: Python<'_>, out: PathBuf) -> PyResult<Vec<PathBuf>> {
        run(py, None, |_| {
            save_together(&out, "calibration.json", |out| {
                self.fit.record.write(out.join("calibration.json")).map_err(input)?;
                self.fit.evaluation.write(out.join("evaluation.json")).map_err(input)?;
                write_text(out.join("report.html"), &self.html()?)?;
                Ok(["calibration.json", "evaluation.json", "report.html"].map(PathBuf::from).to_vec())
            })
        })
    }
}

/// Errors of a rig on datasets.
#[pyclass(frozen, module = "depthcal._depthcal")]
#[derive(Debug)]
pub(crate) struct RigEvaluation {
    evaluated: Vec<(EvaluatedRig, Role)>,
    placed: Vec<PlacedCamera>,
    record: Arc<Record>,
    title: String,
    stages: StageTimes,
    call: String,
}

/// Measures the errors of a rig on datasets.
#[pyfunction]
#[pyo3(signature = (calibration, rigs, title, call, progress))]
pub(crate) fn evaluate_rigs(
    py: Python<'_>,
    calibration: &Calibration,
    rigs: Vec<PyRef<'_, Rig>>,
    title: String,
    call: String,
    progress: Option<Py<PyAny>>,
) -> PyResult<RigEvaluation> {
    let placed = cameras_from_record(&calibration.record, &calibration.register).map_err(input)?;
    let rigs: Vec<(Arc<LoadedRig>, PathBuf)> = rigs.iter().map(|rig| (rig.loaded.clone(), rig.path.clone())).collect();
    let record = calibration.record.clone();
    run(py, progress.as_ref(), move |progress| {
        let mut evaluated = Vec::new();
        for (rig, path) in rigs {
            missing_cameras(&placed, &rig, &path).map_err(input)?;
            let _stage = progress.stage("evaluation");
            let role = if rig.is_fitted_by(&record) { Role::Fitted } else { Role::Other };
            evaluated.push((evaluate_rig(&placed, &rig.capture), role));
        }
        Ok(RigEvaluation { evaluated, placed, record, title, stages: progress.stage_times(), call })
    })
}

impl RigEvaluation {
    fn record(&self) -> depthcal_io::Evaluation {
        evaluation_of(&self.evaluated.iter().map(|(rig, _)| rig).collect::<Vec<_>>(), "")
    }

    fn html(&self) -> Result<String, Failure> {
        let datasets: Vec<_> = self.evaluated.iter().filter_map(|(rig, role)| shown(rig, *role)).collect();
        let report = ReportInput {
            title: format!("Evaluation of {}", self.title),
            command_line: self.call.clone(),
            stages: self.stages.clone(),
            evaluations: &datasets,
            ..ReportInput::default()
        };
        let evaluated: Vec<_> = self.evaluated.iter().map(|(rig, _)| rig).collect();
        html(&report, &ReportRig { cameras: &self.placed, record: &self.record, evaluated: &evaluated })
    }
}

#[pymethods]
impl RigEvaluation {
    /// The record as JSON: `evaluation.json`.
    fn json(&self) -> PyResult<String> {
        json(&self.record())
    }

    /// The errors as a table of text.
    fn table(&self) -> String {
        table(&self.record().datasets, None)
    }

    /// (camera, frame, reason) of every frame that could not be evaluated.
    fn dropped(&self) -> Vec<(String, String, String)> {
        let cameras = self.evaluated.iter().flat_map(|(rig, _)| &rig.cameras);
        let of = cameras.flat_map(|camera| camera.dropped.iter().map(|frame| (camera.name.clone(), frame)));
        of.map(|(camera, f)| (camera, f.name.clone(), f.reason.clone())).collect()
    }

    /// The report as HTML.
    fn report_html(&self, py: Python<'_>) -> PyResult<String> {
        run(py, None, |_| self.html())
    }

    /// Writes `evaluation.json` and `report.html` into a folder; returns the paths.
    fn save(&self, py: Python<'_>, out: PathBuf) -> PyResult<Vec<PathBuf>> {
        run(py, None, |_| {
            Record::check_no_other_in(&out, Some(&self.record), &self.title).map_err(input)?;
            save_together(&out, "evaluation.json", |out| {
                self.record().write(out.join("evaluation.json")).map_err(input)?;
                write_text(out.join("report.html"), &self.html()?)?;
                Ok(["evaluation.json", "report.html"].map(PathBuf::from).to_vec())
            })
        })
    }
}
