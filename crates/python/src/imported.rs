//! Recordings as datasets.

use std::path::PathBuf;

use depthcal_import::{ImportOptions, Pairing};
use depthcal_io::{DATASET_FILE, StagedDataset};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arguments::argument;
use crate::dataset::target_of;
use crate::failure::{Failure, input};
use crate::running::run;

/// How depth is paired with images: by time, by order, or after an offset in seconds.
#[derive(FromPyObject)]
enum GivenPairing {
    #[pyo3(transparent)]
    Offset(f64),
    #[pyo3(transparent)]
    Word(String),
}

/// Imports frames of a recording as a dataset into the folder `out`; returns what was imported as JSON. `options` are `board`
/// (JSON), `image`, `depth`, `frames`, `pair` and `skip_s`.
#[pyfunction]
pub(crate) fn import_recording(
    py: Python<'_>,
    recording: PathBuf,
    out: PathBuf,
    options: &Bound<'_, PyDict>,
    progress: Option<Py<PyAny>>,
) -> PyResult<String> {
    let pairing = match options.get_item("pair")?.map(|pair| pair.extract()).transpose()? {
        None => Pairing::Time,
        Some(GivenPairing::Offset(seconds)) if seconds.is_finite() => Pairing::Offset(seconds),
        Some(GivenPairing::Word(word)) if word == "time" => Pairing::Time,
        Some(GivenPairing::Word(word)) if word == "order" => Pairing::Order,
        Some(_) => return Err(input("pair: give \"time\", \"order\" or a number of seconds").into()),
    };
    let board: Option<String> = argument(options, "board")?;
    let given = ImportOptions {
        image: argument(options, "image")?,
        depth: argument(options, "depth")?,
        board: board.as_deref().map(target_of).transpose()?,
        frames: argument(options, "frames")?,
        pairing,
        skip_s: argument(options, "skip_s")?,
    };
    if !(1..=10_000).contains(&given.frames) {
        return Err(input(format!("frames is {}: give 1 to 10000", given.frames)).into());
    }
    if !(0.0..=1e6).contains(&given.skip_s) {
        return Err(input(format!("skip_s is {}: give a number of seconds from 0 on", given.skip_s)).into());
    }
    let present = out.join(DATASET_FILE);
    if present.exists() {
        return Err(input(format!("{}: there is a dataset already: give another folder", present.display())).into());
    }
    run(py, progress.as_ref(), move |progress| {
        let staged = StagedDataset::within(&out, DATASET_FILE).map_err(input)?;
        let stage = progress.stage("importing");
        let imported = depthcal_import::import(&recording, &staged.folder(), &given).map_err(|error| {
            // Errors name the place where files will be in the end.
            let [hidden, out] = [staged.folder(), out.clone()].map(|path| path.display().to_string());
            Failure::Input(error.to_string().replace(&hidden, &out))
        })?;
        drop(stage);
        staged.commit().map_err(input)?;
        Ok(imported.to_json().to_string())
    })
}
