//! Do hard captures calibrate? Simulated captures as they are, and made hard: a third of the frames keeps only 4 to 8 markers,
//! random ones or ones on a line, and depth pixels lie: 1 % at the end of the sensor's range, 2 % at a background 1.5 m behind
//! the board.
//!
//! `cargo run --release -p depthcal-calibration --features simulate --example hard_captures -- --captures 200`
//!
//! One table: how many captures calibrate, and in how many of them every parameter is within three standard deviations of
//! the truth. Captures that fail are also a line on standard error.

use std::error::Error;
use std::time::Instant;

use depthcal_calibration::calibrate::{CalibrateOptions, calibrate};
use depthcal_calibration::observe::{Capture, MarkerObservation};
use depthcal_calibration::simulated;
use depthcal_model::Target;
use depthcal_simulate::{CameraTruth, Kind, PointOptions, Simulation};
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// What a sensor reports for a pixel without depth that it does not mark as invalid, in units of depth.
const END_OF_RANGE: f64 = 65535.0;
/// Shares of depth pixels there and at the background.
const LYING: [f64; 2] = [0.01, 0.02];
/// Distance of the background from the board, mm.
const BACKGROUND_MM: f64 = 1500.0;

/// How a capture is made hard.
#[derive(Clone, Copy)]
struct Hardness {
    name: &'static str,
    thinned: bool,
    lying: bool,
}

const TABLE: [Hardness; 4] = [
    Hardness { name: "as they are", thinned: false, lying: false },
    Hardness { name: "thinned frames", thinned: true, lying: false },
    Hardness { name: "lying depth", thinned: false, lying: true },
    Hardness { name: "both", thinned: true, lying: true },
];

/// Four to eight markers: of every other frame random ones, of the others neighbours on a line.
fn thin(markers: &mut Vec<MarkerObservation>, target: &Target, on_line: bool, rng: &mut ChaCha8Rng) {
    let count = rng.random_range(4..=8);
    if on_line && let Some(first) = markers.get(rng.random_range(0..markers.len())) {
        let y = target.point(first.index)[1];
        markers.retain(|m| (target.point(m.index)[1] - y).abs() < 1e-6 * target.spacing_mm);
    }
    markers.shuffle(rng);
    markers.truncate(count);
}

fn make_hard(capture: &mut Capture, hardness: Hardness, seed: u64) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let unit_mm = capture.depth_unit_mm.unwrap_or(1.0);
    for (i, frame) in capture.frames.iter_mut().enumerate() {
        if hardness.thinned && i % 3 == 0 && !frame.markers.is_empty() {
            thin(&mut frame.markers, &capture.target, i % 2 == 0, &mut rng);
        }
        for pixel in frame.depth_pixels_mut().iter_mut().filter(|_| hardness.lying) {
            let draw: f64 = rng.random();
            if draw < LYING[0] {
                pixel.depth_mm = END_OF_RANGE * unit_mm;
            } else if draw < LYING[0] + LYING[1] {
                pixel.depth_mm += BACKGROUND_MM;
            }
        }
    }
}

/// What came of a capture.
struct Outcome {
    within: bool,
    dropped: usize,
}

fn run(seed: u64, hardness: Hardness) -> Result<Outcome, Box<dyn Error + Send + Sync>> {
    let camera = CameraTruth::published(1 + (seed % 4) as usize)?;
    let observed = Simulation::new(camera, Kind::General(1), &[], seed).observe_points(&PointOptions::default())?;
    let mut capture = simulated::capture(&observed);
    make_hard(&mut capture, hardness, seed);
    let result = calibrate(&capture, &CalibrateOptions::default())?;
    let truth = simulated::true_theta(&camera);
    let theta = result.camera.theta();
    let stds = result.std_devs();
    let within = (0..theta.len()).all(|i| stds[i].is_none_or(|s| (theta[i] - truth[i]).abs() <= 3.0 * s));
    Ok(Outcome { within, dropped: result.capture.dropped.len() })
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let at = arguments.iter().position(|a| a == "--captures");
    let captures: u64 = at.and_then(|i| arguments.get(i + 1)).and_then(|n| n.parse().ok()).unwrap_or(200);
    println!("{:16} {:>10} {:>16} {:>15} {:>6}", "captures", "calibrated", "within 3 std.", "frames dropped", "s");
    for hardness in TABLE {
        let start = Instant::now();
        let runs: Vec<Outcome> = (0..captures)
            .into_par_iter()
            .filter_map(|seed| run(seed, hardness).inspect_err(|e| eprintln!("{} {seed}: {e}", hardness.name)).ok())
            .collect();
        let within = runs.iter().filter(|r| r.within).count();
        let dropped = runs.iter().map(|r| r.dropped).sum::<usize>() as f64 / runs.len().max(1) as f64;
        let seconds = start.elapsed().as_secs_f64();
        println!(
            "{:16} {:>6}/{captures} {within:>12}/{:<3} {dropped:>15.1} {seconds:>6.0}",
            hardness.name,
            runs.len(),
            runs.len()
        );
    }
}
