//! The result files of a calibration.

use std::path::{Path, PathBuf};

use depthcal_io::{DatasetEvaluation, Evaluation, FileError, FileReference};
use depthcal_model::Register;
use tracing::warn;

use crate::calibrate::Calibrated;
use crate::calibration_record::calibration_record;
use crate::diagnose::effect_scores::effect_scores;
use crate::judge::evaluate::Evaluated;
use crate::load::Loaded;

/// Name of the file of observations; the calibration refers to it.
const OBSERVATIONS: &str = "observations.json";

/// Writes `observations.json`, `calibration.json`, `evaluation.json` and, where effects can be scored, `scores.json` of a calibration into a
/// folder; returns the path of the calibration. `fitted` is the evaluation of the fitted frames, `datasets` what the evaluation file lists,
/// `register` has the effects to score.
///
/// # Errors
///
/// [`FileError`] with the file.
pub fn write_calibration(
    result: &Calibrated,
    fitted: &Evaluated,
    loaded: &Loaded,
    datasets: Vec<DatasetEvaluation>,
    register: &Register,
    out: &Path,
) -> Result<PathBuf, FileError> {
    loaded.observations().write(out.join(OBSERVATIONS))?;
    let observations = FileReference { path: OBSERVATIONS.to_owned(), digest: loaded.reference.digest.clone() };
    let path = out.join("calibration.json");
    calibration_record(result, fitted, loaded.reference.clone(), Some(observations)).write(&path)?;
    write_scores(result, loaded.reference.clone(), register, out)?;
    Evaluation { datasets, ..Evaluation::default() }.write(out.join("evaluation.json"))?;
    Ok(path)
}

/// Writes `scores.json`, for fleets; where there are none, one of an earlier calibration does not stay.
fn write_scores(result: &Calibrated, dataset: FileReference, register: &Register, out: &Path) -> Result<(), FileError> {
    let path = out.join("scores.json");
    // A calibration is as good without scores.
    let scores = effect_scores(result, register, dataset).unwrap_or_else(|error| {
        warn!("no scores.json: {error}");
        None
    });
    match scores {
        Some(scores) => scores.write(&path),
        None if path.exists() => std::fs::remove_file(&path).map_err(|error| FileError::Write { path, error }),
        None => Ok(()),
    }
}
