//! `diff`: two calibrations compared with each other.

use std::path::PathBuf;

use depthcal_calibration::task::{DiffSide, Differed, GivenCamera, Made};
use depthcal_model::Register;
use depthcal_report::{difference_sentences, difference_text};
use pyo3::prelude::*;

use crate::calibrated::Calibration;
use crate::failure::Failure;
use crate::request::json;
use crate::running::run;
use crate::written::{html, save};

/// Two calibrations, compared.
#[pyclass(frozen, module = "depthcal._depthcal")]
#[derive(Debug)]
pub(crate) struct Difference {
    differed: Differed,
    made: Made,
}

/// A calibration in memory, or the path of a file.
#[derive(FromPyObject)]
pub(crate) enum Given<'py> {
    /// A calibration.
    #[pyo3(transparent)]
    Calibration(PyRef<'py, Calibration>),
    /// A `calibration.json`, or a camera file of another program.
    #[pyo3(transparent)]
    File(PathBuf),
}

impl Given<'_> {
    fn side(&self, name: String) -> Result<DiffSide, Failure> {
        Ok(match self {
            Self::Calibration(calibration) => {
                let given = GivenCamera::Calibration(PathBuf::from(&name), Box::new((*calibration.record).clone()));
                DiffSide { name, given, register: calibration.register.clone() }
            }
            Self::File(path) => {
                let path = if path.is_dir() { path.join("calibration.json") } else { path.clone() };
                DiffSide { name, given: GivenCamera::read(&path)?, register: Register::builtin() }
            }
        })
    }
}

/// Compares two calibrations, second minus first; `names` are their names, `size` that of images (px) where neither has one.
#[pyfunction]
#[pyo3(signature = (first, second, names, size, call, progress))]
pub(crate) fn diff(
    py: Python<'_>,
    first: Given<'_>,
    second: Given<'_>,
    names: [String; 2],
    size: Option<[usize; 2]>,
    call: String,
    progress: Option<Py<PyAny>>,
) -> PyResult<Difference> {
    let [of_first, of_second] = names;
    let sides = [first.side(of_first)?, second.side(of_second)?];
    run(py, progress.as_ref(), move |progress| {
        let stage = progress.stage("comparing");
        let differed = Differed::new(&sides, size, "size")?;
        drop(stage);
        Ok(Difference { differed, made: Made { command_line: call, stages: progress.stage_times() } })
    })
}

#[pymethods]
impl Difference {
    /// The record as JSON: `diff.json`.
    fn json(&self) -> PyResult<String> {
        json(&self.differed.record)
    }

    /// The verdict, a sentence for every quantity.
    fn sentences(&self) -> Vec<String> {
        difference_sentences(&self.differed.record)
    }

    /// The difference in words.
    fn text(&self) -> String {
        difference_text(&self.differed.record)
    }

    /// The report as HTML.
    fn report_html(&self, py: Python<'_>) -> PyResult<String> {
        run(py, None, |_| html(&self.differed, &self.made))
    }

    /// Writes `diff.json` and `report.html` into a folder; returns the paths.
    fn save(&self, py: Python<'_>, out: PathBuf) -> PyResult<Vec<PathBuf>> {
        run(py, None, |_| save(&self.differed, &self.made, &out))
    }
}
