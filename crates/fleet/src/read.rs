//! Units from files: calibrations, and the scores next to them.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use depthcal_io::{Calibration, FleetLeftOut, Scores};
use depthcal_model::Register;

use crate::error::FleetError;
use crate::unit::Unit;

/// Name of a calibration in a folder of results.
const CALIBRATION: &str = "calibration.json";
/// Name of the scores next to it.
const SCORES: &str = "scores.json";

/// The units at some paths, each a calibration, a folder of results, or a folder of such folders; and calibrations that cannot be
/// joined, with the reason.
///
/// # Errors
/// [`FleetError`] where there is nothing at a path or a file is at fault.
pub fn read_units(paths: &[PathBuf], register: &Register) -> Result<(Vec<Unit>, Vec<FleetLeftOut>), FleetError> {
    let mut files = Vec::new();
    for path in paths {
        files.extend(calibrations_at(path)?);
    }
    let mut seen = BTreeSet::new();
    files.retain(|file| seen.insert(file.clone()));
    let names = names(&files);
    let (mut units, mut left_out) = (Vec::new(), Vec::new());
    for (file, name) in files.iter().zip(names) {
        let calibration = Calibration::read(file)?;
        let path = file.with_file_name(SCORES);
        let scores = if path.exists() { Some(Scores::read(&path)?) } else { None };
        if let Some(scores) = scores.as_ref().filter(|s| !belong(s, &calibration)) {
            let _ = scores;
            return Err(FleetError::ScoresOfAnother { scores: path, calibration: file.clone() });
        }
        let shown = file.display().to_string();
        match Unit::new(&name, &shown, &calibration, scores.as_ref(), register) {
            Some(unit) => units.push(unit),
            None => left_out.push(FleetLeftOut {
                calibration: shown,
                reason: "it has no covariance: calibrate with the joint estimator".to_owned(),
            }),
        }
    }
    Ok((units, left_out))
}

/// Calibrations at a path, in the order of their names.
fn calibrations_at(path: &Path) -> Result<Vec<PathBuf>, FleetError> {
    let none = || FleetError::NoCalibration { path: path.to_owned() };
    if !path.is_dir() {
        return if path.exists() { Ok(vec![path.to_owned()]) } else { Err(none()) };
    }
    let calibration = path.join(CALIBRATION);
    if calibration.exists() {
        return Ok(vec![calibration]);
    }
    let entries = std::fs::read_dir(path).map_err(|_| none())?;
    let mut calibrations: Vec<PathBuf> =
        entries.flatten().map(|entry| entry.path().join(CALIBRATION)).filter(|file| file.exists()).collect();
    calibrations.sort();
    if calibrations.is_empty() { Err(none()) } else { Ok(calibrations) }
}

/// A name for every calibration: its folder's, or its path where that is not unique.
fn names(files: &[PathBuf]) -> Vec<String> {
    let short = |file: &PathBuf| {
        let folder = file.parent().and_then(Path::file_name).map(|name| name.to_string_lossy().into_owned());
        let stem = file.file_stem().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        match (folder, file.file_name().is_some_and(|name| name == CALIBRATION)) {
            (Some(folder), true) => folder,
            _ => stem,
        }
    };
    let all: Vec<String> = files.iter().map(short).collect();
    let unique = |name: &String| all.iter().filter(|other| *other == name).count() == 1;
    files
        .iter()
        .zip(&all)
        .map(|(file, name)| if unique(name) { name.clone() } else { file.display().to_string() })
        .collect()
}

/// Whether scores were taken at the parameters of a calibration.
fn belong(scores: &Scores, calibration: &Calibration) -> bool {
    let value = |name: &str| {
        let (piece, parameter) = name.split_once('.')?;
        calibration.value(piece, parameter)
    };
    scores.dataset.digest == calibration.dataset.digest
        && scores.model.iter().all(|model| value(&model.name) == Some(model.value))
}
