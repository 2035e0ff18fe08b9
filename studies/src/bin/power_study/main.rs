//! Does the loop find what is missing? Simulated captures with an undeclared effect at one, two and four times the size that
//! they can just show, clean ones, ones with effects that the catalogue does not have, and two effects at once; one table
//! each.
//!
//! `cargo run --release -p depthcal-studies --bin power_study -- --seeds 10 --level points`
//!
//! | option | |
//! |---|---|
//! | `--level points` or `images` | observations with noise, or images and depth images that are rendered and detected |
//! | `--what single,placed,clean,heavy,bad,beyond,absent,pairs` | which tables |
//! | `--what faultless,nature,fine,formulas,rediscovered,several,coverage,sensitivity` | tables that are made on request only |
//! | `--effects a,b` | these effects only |
//! | `--thresholds a,b` | these thresholds only, in `sensitivity` |
//! | `--factors 1,2,4` | sizes, in units of the detectable size |
//! | `--seeds N` | captures per row, every one with its own camera, poses and noise |
//! | `--first K` | number of the first of them (0): a study in parts, or one capture again |
//!
//! Every run is also a line on standard error, so that rows can be looked into; with `RUST_LOG=info` the loop's own messages too.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program that prints")]

mod beyond;
mod coverage;
mod drawn;
mod fine;
mod formulas;
mod nature;
mod nothing;
mod pairs;
mod placed;
mod rediscovered;
mod sensitivity;
mod several;
mod single;
mod size;

use std::error::Error;
use std::ops::Range;
use std::path::Path;
use std::time::Instant;

use depthcal::calibration::diagnose::{CameraDiagnoseOptions, CameraDiagnosis, HeldOut, diagnose_camera};
use depthcal::calibration::load::{LoadOptions, load};
use depthcal::calibration::observe::CameraFrames;
use depthcal::calibration::simulated;
use depthcal_simulate::{CameraTruth, Effect, Kind, PointOptions, Simulation};

/// Tables that are made without being asked for.
const USUAL: &str = "single,placed,clean,heavy,bad,beyond,absent,pairs";

const USAGE: &str = "\
power_study [--what TABLES] [--level points|images] [--seeds N] [--first K] [--effects a,b] [--factors 1,2,4] [--thresholds a,b]

tables: single, placed, clean, heavy, bad, beyond, absent, pairs; on request: faultless, nature, fine, formulas, rediscovered,
several, coverage, sensitivity";

/// Anything that can go wrong in a run: it is said, and the run is left out.
type Failure = Box<dyn Error + Send + Sync>;

/// Options of a study.
struct Study {
    images: bool,
    first: u64,
    seeds: u64,
    effects: Vec<String>,
    thresholds: Vec<String>,
    factors: Vec<f64>,
}

/// A capture with effects by one of the thesis' four cameras; the seed decides which, and poses, noise and the shape of the
/// effects.
fn simulation(effects: &[Effect], seed: u64) -> Result<Simulation, Failure> {
    let camera = CameraTruth::published(1 + (seed % 4) as usize)?;
    Ok(Simulation::new(camera, Kind::General(1), effects, 100 + seed).unit(seed))
}

impl Study {
    fn wants(&self, effect: &str) -> bool {
        self.effects.is_empty() || self.effects.iter().any(|n| n == effect)
    }

    /// Numbers of the captures of a row.
    fn numbers(&self) -> Range<u64> {
        self.first..self.first + self.seeds
    }

    fn capture(&self, simulation: &Simulation) -> Result<CameraFrames, Failure> {
        if !self.images {
            return Ok(simulated::capture(&simulation.observe_points(&PointOptions::default())?));
        }
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("capture");
        simulation.write_dataset(&path)?;
        load_anew(&path)
    }

    fn diagnose(&self, simulation: &Simulation) -> Result<CameraDiagnosis, Failure> {
        Ok(diagnose_camera(&self.capture(simulation)?, None, &CameraDiagnoseOptions::default())?)
    }
}

/// The capture of a dataset on disk, detected anew.
fn load_anew(path: &Path) -> Result<CameraFrames, Failure> {
    Ok(load(path, &LoadOptions { cache: None, ..LoadOptions::default() })?.into_only_camera()?.capture)
}

/// The names of a diagnosis, in order.
fn names(diagnosis: &CameraDiagnosis) -> Vec<String> {
    diagnosis.steps.iter().map(|s| s.effects[0].clone()).collect()
}

fn depth_rms_mm(held_out: &HeldOut) -> f64 {
    held_out.errors.depth_rms_mm.unwrap_or(f64::NAN)
}

fn percent(n: usize, of: usize) -> String {
    format!("{:.0} %", 100.0 * n as f64 / of.max(1) as f64)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.retain(|v| v.is_finite());
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

fn main() {
    let filter = tracing_subscriber::EnvFilter::from_default_env();
    tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).without_time().init();
    let arguments: Vec<String> = std::env::args().collect();
    if arguments.iter().any(|a| a == "--help" || a == "-h") {
        println!("{USAGE}");
        return;
    }
    let value = |key: &str, default: &str| -> String {
        let key = arguments.iter().position(|a| a == key);
        key.and_then(|i| arguments.get(i + 1)).cloned().unwrap_or_else(|| default.to_owned())
    };
    let list = |text: String| -> Vec<String> { text.split(',').filter(|t| !t.is_empty()).map(str::to_owned).collect() };
    let study = Study {
        images: value("--level", "points") == "images",
        first: value("--first", "0").parse().unwrap_or(0),
        seeds: value("--seeds", "5").parse().unwrap_or(5),
        effects: list(value("--effects", "")),
        thresholds: list(value("--thresholds", "")),
        factors: list(value("--factors", "1,2,4")).iter().filter_map(|f| f.parse().ok()).collect(),
    };
    let start = Instant::now();
    for what in list(value("--what", USUAL)) {
        match what.as_str() {
            "single" => study.single(),
            "placed" => study.placed(),
            "clean" => study.clean(),
            "heavy" => study.heavy_tails(),
            "bad" => study.bad_frames(),
            "beyond" => study.beyond(),
            "absent" => study.absent(),
            "pairs" => study.pairs(),
            "faultless" => study.faultless(),
            "nature" => study.nature(),
            "fine" => study.fine(),
            "formulas" => study.formulas(),
            "rediscovered" => study.rediscovered(),
            "several" => study.several(),
            "coverage" => study.coverage(),
            "sensitivity" => study.sensitivity(),
            other => eprintln!("there is no table '{other}'\n\n{USAGE}"),
        }
    }
    eprintln!("{:.0} s", start.elapsed().as_secs_f64());
}
