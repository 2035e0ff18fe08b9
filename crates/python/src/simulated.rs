//! Simulated captures, for examples and tests.

use std::path::PathBuf;
use std::sync::Arc;

use depthcal_calibration::load::{Loaded, LoadedCamera, declared_in_memory};
use depthcal_calibration::observe::CameraFrames;
use depthcal_calibration::simulated::capture;
use depthcal_io::{FileReference, digest_contents, write_json};
use depthcal_simulate::{Board, CameraTruth, Effect, Kind, Pattern, PointOptions, Simulation};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arguments::argument;
use crate::dataset::Dataset;
use crate::failure::input;
use crate::running::run;

/// The simulation of the arguments `camera`, `kind`, `effects`, `seed`, `unit`, `frames` and `board`.
fn simulation(given: &Bound<'_, PyDict>) -> PyResult<Simulation> {
    let (camera, kind): (String, String) = (argument(given, "camera")?, argument(given, "kind")?);
    let camera = if camera == "fisheye" {
        CameraTruth::fisheye_150()
    } else {
        let number = camera.parse().map_err(|_| input(format!("camera {camera}: write 1, 2, 3, 4 or fisheye")))?;
        CameraTruth::published(number).map_err(|e| input(format!("camera: {e}")))?
    };
    let kind: Kind = kind.parse().map_err(|e| input(format!("kind: {e}")))?;
    let effects: Vec<String> = argument(given, "effects")?;
    let effects = effects.iter().filter_map(|text| Effect::parse(text).transpose());
    let effects: Vec<Effect> = effects.collect::<Result<_, _>>().map_err(|e| input(format!("effects: {e}")))?;
    let mut simulation =
        Simulation::new(camera, kind, &effects, argument(given, "seed")?).unit(argument(given, "unit")?);
    match argument::<Option<String>>(given, "board")?.as_deref() {
        None | Some("asymmetric-circles") => {}
        Some("chessboard") => {
            let board =
                Board { pattern: Pattern::Chessboard, columns: 9, rows: 6, spacing_mm: 25.0, ..Board::default() };
            simulation = simulation.board(board);
        }
        Some(other) => return Err(input(format!("board '{other}': write asymmetric-circles or chessboard")).into()),
    }
    if let Some(frames) = argument(given, "frames")? {
        simulation = simulation.frames(frames);
    }
    // Errors of the simulation show before a folder is created.
    simulation.truth().map_err(input)?;
    Ok(simulation)
}

/// Renders the dataset of a [`simulation`] into a new or empty folder; returns the number of frames.
#[pyfunction]
pub(crate) fn simulate(
    py: Python<'_>,
    out: PathBuf,
    given: &Bound<'_, PyDict>,
    truth: Option<PathBuf>,
) -> PyResult<usize> {
    let simulation = simulation(given)?;
    let is_used = std::fs::read_dir(&out).is_ok_and(|mut entries| entries.next().is_some());
    if is_used {
        return Err(input(format!("{} is not empty: give a new or an empty folder", out.display())).into());
    }
    run(py, None, move |_| {
        let written = simulation.write_dataset(&out).map_err(input)?;
        if let Some(path) = truth {
            write_json(&path, &written).map_err(input)?;
        }
        Ok(written.frames.len())
    })
}

/// A dataset of markers and `samples` depth pixels per frame of a [`simulation`], without images.
#[pyfunction]
pub(crate) fn simulate_points(py: Python<'_>, given: &Bound<'_, PyDict>, samples: usize) -> PyResult<Dataset> {
    let (simulation, unit) = (simulation(given)?, argument::<u64>(given, "unit")?);
    let seed: u64 = argument(given, "seed")?;
    run(py, None, move |_| {
        let options = PointOptions { depth_samples: samples, ..PointOptions::default() };
        let observed = simulation.observe_points(&options).map_err(input)?;
        let capture = capture(&observed);
        let name = format!("{}-{unit}-{seed}", capture.name);
        let declared = declared_in_memory(&name, &capture.target, capture.depth_unit_mm);
        let content = serde_json::to_vec(&observed).map_err(input)?;
        let reference = FileReference { path: name.clone(), digest: digest_contents([(name.clone(), content)]) };
        let camera = LoadedCamera::of_capture(declared, reference, CameraFrames { name, ..capture });
        Ok(Dataset { loaded: Arc::new(Loaded::of_camera(camera)) })
    })
}
