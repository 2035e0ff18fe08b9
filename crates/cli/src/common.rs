//! Options, files and failures that several commands share.

use std::path::{Path, PathBuf};

use clap::Args;
use depthcal_io::{Calibration, Dataset, Pairing};
use depthcal_model::{Camera, Register};

use crate::progress::Progress;
use depthcal_calibration::calibration_record::camera_from_record;
use depthcal_calibration::judge::evaluate::Evaluated;
use depthcal_calibration::load::{LoadOptions, Loaded, default_cache, load};
use depthcal_calibration::observe::DroppedFrame;
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
pub(super) fn print_not_evaluated(evaluated: &Evaluated, known: &[DroppedFrame]) {
    for frame in evaluated.dropped.iter().filter(|f| known.iter().all(|k| k.name != f.name)) {
        say!("  not evaluated: {} ({})", frame.name, frame.reason);
    }
}

/// Prints how images and depth were paired, where it is not by equal names.
pub(super) fn print_pairing(dataset: &Dataset) {
    if dataset.pairing != Pairing::Stem {
        say!("  {}", dataset.pairing);
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
    /// Markers that another program found, in mrcal's format (`# filename x y level`, all corners of an image row by row of the board, `-` for
    /// those that were not found); the board is then not searched.
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

    /// Reads a dataset and prints in how many frames the board was found.
    pub(super) fn load(&self, path: &Path, session: &Session) -> Result<Loaded, Failure> {
        let busy = Progress::busy("reading");
        let loaded = load(path, &self.options(session)).map_err(input)?;
        drop(busy);
        let strays = loaded.dataset.strays.len();
        let (found, dropped) = (loaded.capture.frames.len(), loaded.capture.dropped.len() - strays);
        let from = match &loaded.markers {
            Some(file) => format!(" (markers from {})", file.path),
            None if loaded.from_cache => " (cached)".to_owned(),
            None => String::new(),
        };
        say!("{}: the board was found in {found} of {}{from}", loaded.dataset.name, count(found + dropped, "frame"));
        print_pairing(&loaded.dataset);
        for frame in &loaded.capture.dropped {
            say!("  not used: {} ({})", frame.name, frame.reason);
        }
        if let Some(layout) = loaded.charuco_layout {
            say!("  the board has {layout}");
        }
        // A diameter that contradicts its declaration is a warning of the library.
        if let Some(measured) = loaded.circle_diameter.filter(|m| m.declared_mm.is_none()) {
            say!("  {measured}");
        }
        Ok(loaded)
    }
}

/// The command line, for the report.
pub(super) fn command_line() -> String {
    let words = std::env::args().skip(1);
    std::iter::once("depthcal".to_owned()).chain(words).collect::<Vec<_>>().join(" ")
}

/// Reads a calibration and its camera.
pub(super) fn read_calibration(path: &Path, register: &Register) -> Result<(Calibration, Camera), Failure> {
    let calibration = Calibration::read(path).map_err(input)?;
    let camera = camera_from_record(&calibration.camera, register)
        .map_err(|e| Failure::Input(format!("{}: {e}", path.display())))?;
    Ok((calibration, camera))
}
