//! `fleet`: calibrations of one camera type joined.

use std::path::PathBuf;

use depthcal_calibration::task::Made;
use depthcal_fleet::{FleetError, FleetOptions, Joined, Unit, join, read_units};
use depthcal_io::{Calibration, FleetLeftOut, Scores};
use depthcal_model::Register;
use depthcal_report::{FleetResults, fleet_text};
use pyo3::prelude::*;

use crate::effect::Effect;
use crate::failure::{Failure, input};
use crate::request::{json, register_with};
use crate::running::run;
use crate::written::{html, save};

/// A fleet.
#[pyclass(frozen, module = "depthcal._depthcal")]
#[derive(Debug)]
pub(crate) struct Fleet {
    joined: Joined,
    made: Made,
}

impl From<FleetError> for Failure {
    fn from(error: FleetError) -> Self {
        match error {
            FleetError::NotPositiveDefinite => Self::Untrusted(error.to_string()),
            other => input(other),
        }
    }
}

/// A unit in memory: its name, and the JSON of its calibration and of the scores of effects that its model lacks.
type UnitInMemory = (String, String, Option<String>);

fn unit_of(
    (name, calibration, scores): &UnitInMemory,
    register: &Register,
) -> Result<Result<Unit, FleetLeftOut>, Failure> {
    let calibration: Calibration = serde_json::from_str(calibration).map_err(|e| input(format!("{name}: {e}")))?;
    if !calibration.is_short() {
        let problem = "is of several cameras: give one by camera(NAME), or save it and give the folders of one camera";
        return Err(input(format!("{name} {problem}")));
    }
    let scores = scores.as_deref().map(serde_json::from_str::<Scores>).transpose();
    let scores = scores.map_err(|e| input(format!("{name}: {e}")))?;
    Ok(Unit::new(name, name, &calibration, scores.as_ref(), register).ok_or_else(|| FleetLeftOut {
        calibration: name.clone(),
        reason: "it has no covariance: calibrate with the joint estimator".to_owned(),
    }))
}

/// Joins calibrations, folders of results, or folders of such folders, and units in memory.
#[pyfunction]
#[pyo3(signature = (calibrations, in_memory, level, effects, call, progress))]
pub(crate) fn fleet(
    py: Python<'_>,
    calibrations: Vec<PathBuf>,
    in_memory: Vec<UnitInMemory>,
    level: f64,
    effects: Vec<PyRef<'_, Effect>>,
    call: String,
    progress: Option<Py<PyAny>>,
) -> PyResult<Fleet> {
    if !(level > 0.0 && level < 1.0) {
        return Err(input(format!("level is {level}: give a number between 0 and 1")).into());
    }
    let register = register_with(&effects)?;
    run(py, progress.as_ref(), move |progress| {
        let stage = progress.stage("joining units");
        let (mut units, mut left_out) = read_units(&calibrations, &register)?;
        for unit in &in_memory {
            match unit_of(unit, &register)? {
                Ok(unit) => units.push(unit),
                Err(reason) => left_out.push(reason),
            }
        }
        let joined = join(units, left_out, &FleetOptions { level })?;
        drop(stage);
        Ok(Fleet { joined, made: Made { command_line: call, stages: progress.stage_times() } })
    })
}

impl Fleet {
    fn results(&self) -> FleetResults<'_> {
        FleetResults { fleet: &self.joined.fleet, prior: &self.joined.prior }
    }
}

#[pymethods]
impl Fleet {
    /// The record as JSON: `fleet.json`.
    fn json(&self) -> PyResult<String> {
        json(&self.joined.fleet)
    }

    /// The distribution of the next unit's parameters, as JSON: `prior.json`.
    fn prior(&self) -> PyResult<String> {
        json(&self.joined.prior)
    }

    /// The fleet in words.
    fn text(&self) -> String {
        fleet_text(&self.joined.fleet)
    }

    /// The report as HTML.
    fn report_html(&self, py: Python<'_>) -> PyResult<String> {
        run(py, None, |_| html(&self.results(), &self.made))
    }

    /// Writes `fleet.json`, `prior.json` and `report.html` into a folder; returns the paths.
    fn save(&self, py: Python<'_>, out: PathBuf) -> PyResult<Vec<PathBuf>> {
        run(py, None, |_| save(&self.results(), &self.made, &out))
    }
}
