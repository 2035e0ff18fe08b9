//! Calibration from corners alone, timed: from the markers of an `observations.json` to camera, poses and covariance, with start
//! values that are found here.
//!
//! `cargo run --release -p depthcal-benches --bin image_corners -- FILE --threads 2 --repeats 5 [--lens brown-conrady:full]`
//!
//! Prints one line of JSON: `walls` (seconds of every repetition), `wall` (their median), `cpus` (processor time of all threads,
//! where the system tells, otherwise 0), `rms` (root mean square distance, px),
//! `pinhole` (fx fy cx cy), `std_fx`, `lens`, `order` where the order of the lens was chosen, `frames` that were used.
//! `benches/image_peers.py` runs it beside other programs.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program that prints")]

use std::error::Error;
use std::path::PathBuf;
use std::time::Instant;

use depthcal_calibration::calibrate::{CameraOptions, calibrate_image};
use depthcal_calibration::observe::{CameraFrames, DetectedFrame, MarkerObservation, RawFrame};
use depthcal_io::record::Observations;

/// The value after an argument, or the one given here.
fn argument<T: std::str::FromStr>(name: &str, otherwise: T) -> Result<T, String> {
    let mut values = std::env::args().skip_while(|a| a != name).skip(1);
    match values.next() {
        Some(value) => value.parse().map_err(|_| format!("{name} cannot be {value}")),
        None => Ok(otherwise),
    }
}

/// The frames whose board was found.
fn capture(observations: &Observations) -> Result<CameraFrames, Box<dyn Error>> {
    let first = observations.frames.first().ok_or("the file has no frames")?;
    let detected = observations.frames.iter().filter(|f| !f.markers.is_empty());
    let frames = detected.map(|frame| {
        let raw = RawFrame { name: frame.name.clone(), ..RawFrame::default() };
        let markers =
            frame.markers.iter().map(|m| MarkerObservation { index: m.index, pixel: m.pixel, std_px: m.std_px });
        DetectedFrame { raw, markers: markers.collect(), ..DetectedFrame::default() }
    });
    Ok(CameraFrames {
        name: observations.dataset.path.clone(),
        target: observations.target.clone(),
        width: first.width,
        height: first.height,
        depth_unit_mm: None,
        disparity: None,
        technology: None,
        frames: frames.collect(),
        dropped: Vec::new(),
    })
}

/// Processor time of all threads, s, as Linux tells it.
fn processor_time() -> f64 {
    let Ok(threads) = std::fs::read_dir("/proc/self/task") else { return 0.0 };
    let time_of_thread = |path: PathBuf| -> Option<f64> {
        std::fs::read_to_string(path.join("schedstat")).ok()?.split(' ').next()?.parse().ok()
    };
    let nanoseconds: f64 = threads.flatten().filter_map(|thread| time_of_thread(thread.path())).sum();
    1e-9 * nanoseconds
}

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).ok_or("usage: image_corners FILE [--threads N] [--repeats N] [--lens LENS]")?;
    let (threads, repeats) = (argument("--threads", 0)?, argument("--repeats", 5_usize)?.max(1));
    rayon::ThreadPoolBuilder::new().num_threads(threads).build_global()?;
    let options = CameraOptions { lens: argument("--lens", "brown-conrady".to_owned())?, ..CameraOptions::default() };
    let capture = capture(&Observations::read(&path)?)?;
    let mut timed = Vec::with_capacity(repeats);
    for _ in 0..repeats {
        let (begin, processor) = (Instant::now(), processor_time());
        let fit = calibrate_image(&capture, &options)?;
        timed.push((begin.elapsed().as_secs_f64(), processor_time() - processor, fit));
    }
    let walls: Vec<f64> = timed.iter().map(|t| t.0).collect();
    let cpus: Vec<f64> = timed.iter().map(|t| t.1).collect();
    let mut sorted = walls.clone();
    sorted.sort_by(f64::total_cmp);
    let fit = &timed[0].2;
    // Standard deviations are in the order of the blocks: lens, pinhole.
    let mut deviations = fit.std_devs().into_iter();
    let (mut lens, mut std_fx) = (Vec::new(), None);
    for block in fit.camera.blocks() {
        let std_devs: Vec<Option<f64>> = deviations.by_ref().take(block.theta.len()).collect();
        match block.piece() {
            Some(_) => lens.extend_from_slice(&block.theta),
            None => std_fx = std_devs[0],
        }
    }
    println!(
        "{}",
        serde_json::json!({
            "wall": sorted[sorted.len() / 2], "walls": walls, "cpus": cpus, "rms": fit.reprojection_rms_px, "pinhole": fit.camera.pinhole()[..4],
            "std_fx": std_fx, "lens": lens, "order": fit.lens_choice.as_ref().map(|c| c.order.to_string()),
            "frames": fit.capture.frames.len(), "sigma_px": fit.noise.pixel_sigma, "threads": threads,
        })
    );
    Ok(())
}
