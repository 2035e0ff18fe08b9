//! Options, files and failures that several commands share.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;
use clap::builder::{PathBufValueParser, TypedValueParser};
use depthcal_formula::{FormulaEffect, FormulaFile};
use depthcal_io::{Calibration, Dataset, DatasetCamera, Pairing};
use depthcal_model::{Camera, Register};

use crate::progress::Progress;
use depthcal_calibration::camera_record::camera_from_record;
use depthcal_calibration::camera_record::cameras_from_record;
use depthcal_calibration::judge::camera::EvaluatedCamera;
use depthcal_calibration::load::{LoadOptions, Loaded, LoadedCamera, default_cache, load};
use depthcal_calibration::observe::{DroppedFrame, PlacedCamera};
use depthcal_calibration::task::{Made, TaskError};
use depthcal_report::format::count;
use serde_json::{Value, json};

use super::failure::{Failure, input};
use super::session::Session;
use super::voice::say;

/// For `--json`: the number of used frames, and the others with reasons.
pub(super) fn frames_of(name: &str, used: usize, dropped: &[DroppedFrame]) -> Value {
    let dropped: Vec<Value> = dropped.iter().map(|d| json!({ "name": d.name, "reason": d.reason })).collect();
    json!({ "dataset": name, "used": used, "dropped": dropped })
}

/// Prints the frames that could not be evaluated, without those of `known`, which are printed already.
pub(super) fn print_not_evaluated(evaluated: &EvaluatedCamera, known: &[DroppedFrame]) {
    for frame in evaluated.dropped.iter().filter(|f| known.iter().all(|k| k.name != f.name)) {
        say!("  not evaluated: {} ({})", frame.name, frame.reason);
    }
}

/// Prints how images and depth were paired, where it is not by equal names.
pub(super) fn print_pairing(camera: &DatasetCamera) {
    if camera.pairing != Pairing::Stem {
        say!("  {}", camera.pairing);
    }
}

/// A result file as a value for `--json`.
pub(super) fn value_of(record: &impl serde::Serialize) -> Result<Value, Failure> {
    serde_json::to_value(record).map_err(input)
}

/// The folder of the results.
#[derive(Debug, Args)]
pub(super) struct Output {
    /// Folder for the results; created if it does not exist.
    #[arg(long, value_name = "DIR")]
    pub(super) out: PathBuf,
}

/// Options of reading datasets.
#[derive(Debug, Args)]
pub(super) struct Reading {
    /// Detects the board again, even if a detection of the same images is cached.
    #[arg(long)]
    pub(super) refresh: bool,
    /// Does not use the cache of detections.
    #[arg(long)]
    pub(super) no_cache: bool,
    /// Markers that another program found, in mrcal's format (`# filename x y level`, all corners of an image row by row of the
    /// board, `-` for those that were not found); the board is then not searched.
    #[arg(long, value_name = "FILE")]
    pub(super) markers: Option<PathBuf>,
    /// Images beyond so many MiB leave memory and are read again from their files when they are needed.
    #[arg(long, value_name = "MIB", default_value_t = 1024, value_parser = clap::value_parser!(u32))]
    pub(super) image_memory: u32,
}

impl Reading {
    pub(super) fn options(&self, session: &Session) -> LoadOptions {
        let cache = if self.no_cache { None } else { default_cache() };
        LoadOptions {
            cache,
            refresh: self.refresh,
            markers: self.markers.clone(),
            register: session.register.clone(),
            image_memory: self.image_memory as usize * (1 << 20),
            progress: session.progress.clone(),
        }
    }

    /// Reads a dataset and prints in how many frames each camera found the board.
    pub(super) fn load(&self, path: &Path, session: &Session) -> Result<Arc<Loaded>, Failure> {
        let busy = Progress::busy("reading");
        let loaded = load(path, &self.options(session)).map_err(input)?;
        drop(busy);
        match loaded.cameras.as_slice() {
            [camera] => print_loaded(camera, &loaded.name, ""),
            cameras => {
                say!("{}: {}", loaded.name, count(cameras.len(), "camera"));
                cameras.iter().for_each(|camera| print_loaded(camera, camera.name(), "  "));
            }
        }
        Ok(Arc::new(loaded))
    }
}

/// Prints in how many frames a camera, which is called `name`, found the board; every line begins with `indent`.
fn print_loaded(camera: &LoadedCamera, name: &str, indent: &str) {
    let strays = camera.declared.strays.len();
    let (with_board, dropped) = (camera.capture.frames.len(), camera.capture.dropped.len() - strays);
    if camera.declared.has_images() || camera.has_markers() {
        let from = match &camera.markers {
            Some(file) => format!(" (markers from {})", file.path),
            None if camera.from_cache => " (cached)".to_owned(),
            None => String::new(),
        };
        say!("{indent}{name}: the board was found in {with_board} of {}{from}", count(with_board + dropped, "frame"));
    } else {
        say!("{indent}{name}: {} of depth without images", count(with_board, "frame"));
    }
    print_pairing(&camera.declared);
    for frame in &camera.capture.dropped {
        say!("{indent}  not used: {} ({})", frame.name, frame.reason);
    }
    if let Some(layout) = camera.charuco_layout {
        say!("{indent}  the board has {layout}");
    }
    // A diameter that contradicts its declaration is a warning of the library.
    if let Some(measured) = camera.circle_diameter.filter(|m| m.declared_mm.is_none()) {
        say!("{indent}  {measured}");
    }
}

/// Number of cameras that a dataset declares, for which `check` accepts the options; its files are not read. Options that mean
/// nothing are named first, also where there is no dataset.
pub(super) fn camera_count(path: &Path, check: impl FnOnce(usize) -> Result<(), TaskError>) -> Result<usize, Failure> {
    let cameras = Dataset::open(path).map(|dataset| dataset.cameras.len());
    check(*cameras.as_ref().unwrap_or(&1))?;
    cameras.map_err(input)
}

/// Refuses a value of an option that is not above 0; `give` says what to give instead.
pub(super) fn above_zero(option: &str, value: Option<f64>, give: &str) -> Result<(), Failure> {
    match value.filter(|value| !(value.is_finite() && *value > 0.0)) {
        Some(value) => Err(Failure::Input(format!("{option} is {value}: give {give}"))),
        None => Ok(()),
    }
}

/// How the results of a run are made, up to now.
pub(super) fn made(session: &Session) -> Made {
    Made { command_line: command_line(), stages: session.progress.stage_times() }
}

/// The command line, for the report.
fn command_line() -> String {
    let words = std::env::args().skip(1);
    std::iter::once("depthcal".to_owned()).chain(words).collect::<Vec<_>>().join(" ")
}

/// Parses the path of a calibration: in a folder of results it is calibration.json.
pub(super) fn calibration_path() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().map(|path: PathBuf| if path.is_dir() { path.join("calibration.json") } else { path })
}

/// Reads a calibration and its camera, of a rig the reference.
pub(super) fn read_calibration(path: &Path, register: &Register) -> Result<(Calibration, Camera), Failure> {
    let calibration = Calibration::read(path).map_err(input)?;
    let camera = camera_from_record(&calibration.camera, register)
        .map_err(|e| Failure::Input(format!("{}: {e}", path.display())))?;
    Ok((calibration, camera))
}

/// The effects of a file of formulas.
pub(super) fn read_formulas(path: &Path) -> Result<Vec<FormulaEffect>, Failure> {
    Ok(FormulaFile::read(path).map_err(input)?.effects().to_vec())
}

/// The cameras of the calibration that was read from a file.
pub(super) fn read_cameras(
    path: &Path,
    calibration: &Calibration,
    register: &Register,
) -> Result<Vec<PlacedCamera>, Failure> {
    cameras_from_record(calibration, register).map_err(|e| Failure::Input(format!("{}: {e}", path.display())))
}
