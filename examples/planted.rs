//! A measured capture with an effect planted in its depth images that nobody declares: is it found on top of the camera's own?
//!
//! `cargo run --release --example planted -- DATASET [--effects cyclic_depth=4,temporal_drift=6,depth_registration=2]`
//!
//! Frames get times of 10 s each where the dataset has none, so that drifts have something to follow.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program that prints")]

use std::error::Error;
use std::path::Path;

use depthcal::calibration::calibrate::{CameraOptions, calibrate_camera};
use depthcal::calibration::diagnose::record::to_file;
use depthcal::calibration::diagnose::{CameraDiagnoseOptions, CameraDiagnosis, diagnose_camera};
use depthcal::calibration::load::{LoadOptions, load};
use depthcal::calibration::simulated;
use depthcal::io::FileReference;
use depthcal::model::Register;
use depthcal::report::{Detail, diagnosis_text};
use depthcal_simulate::Effect;

const DEFAULT: &str = "none,cyclic_depth=4,temporal_drift=6,depth_registration=3,range_offset=15,radial_range=8,\
                       disparity_ripple=4,smooth_map=6,row_banding=6";

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (dataset, effects) = match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [dataset] => (dataset, DEFAULT),
        [dataset, "--effects", list] => (dataset, list),
        _ => return Err("usage: planted DATASET [--effects NAME=SIZE,…]".into()),
    };
    let mut capture = load(Path::new(dataset), &LoadOptions::default())?.into_only_camera()?.capture;
    if capture.frames.iter().all(|f| f.time_s == 0.0) {
        capture.frames.iter_mut().enumerate().for_each(|(i, f)| f.time_s = 10.0 * i as f64);
    }
    let camera = calibrate_camera(&capture, &CameraOptions::default())?.camera;
    println!("| planted | rms of it, mm | added | said rms, mm | verdict | depth rms before, mm | after, mm |");
    println!("|---|---|---|---|---|---|---|");
    for text in effects.split(',') {
        let effect = Effect::parse(text)?;
        let (planted, rms_mm) = match &effect {
            Some(effect) => simulated::planted(&capture, camera.pinhole(), effect)?,
            None => (capture.clone(), 0.0),
        };
        let d = diagnose_camera(&planted, None, &CameraDiagnoseOptions::default())?;
        println!("| {text} | {rms_mm:.2} | {}", row(&d));
        let record = to_file(&d, FileReference::default(), "projective".parse()?);
        eprintln!("{text}\n{}", diagnosis_text(&record, &Register::builtin(), Detail::All));
    }
    Ok(())
}

fn row(d: &CameraDiagnosis) -> String {
    let names: Vec<&str> = d.steps.iter().map(|s| s.effects[0].as_str()).collect();
    let sizes: Vec<String> = d.steps.iter().map(|s| format!("{:.2}", s.size_mm)).collect();
    let mm = |h: &depthcal::calibration::diagnose::HeldOut| h.errors.depth_rms_mm.unwrap_or(f64::NAN);
    let (before, after) = (mm(&d.before), mm(&d.after));
    format!("{} | {} | {:?} | {before:.2} | {after:.2} |", names.join(", "), sizes.join(", "), d.verdict)
}
