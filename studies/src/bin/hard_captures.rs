//! Do hard captures calibrate? Simulated captures as they are, and made hard: a third of the frames keeps only 4 to 8 markers,
//! random ones, ones on a line or ones close together, and depth pixels lie: 1 % at the end of the sensor's range, 2 % at a
//! background 1.5 m behind the board.
//!
//! `cargo run --release -p depthcal-studies --bin hard_captures -- --captures 200`
//!
//! `--lens brown-conrady:full` fits all terms of the lens, `--rows 2` leaves out the captures with lying depth, and with
//! `--folds 5` the frames that are left have to be fitted in five parts as well.
//!
//! One table: how many captures calibrate, and in how many of them every parameter is within three standard deviations of
//! the truth. Captures that fail or are not are also a line on standard error.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program that prints")]

use std::error::Error;
use std::time::Instant;

use depthcal_calibration::calibrate::{CameraOptions, calibrate_camera};
use depthcal_calibration::judge::cross_validation::cross_validate_camera;
use depthcal_calibration::judge::parts::Parts;
use depthcal_calibration::observe::{CameraFrames, MarkerObservation};
use depthcal_calibration::simulated;
use depthcal_model::Target;
use depthcal_simulate::{CameraTruth, Kind, PointOptions, Simulation};
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// Value of a pixel without depth that the sensor does not mark as invalid, in units of depth.
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

/// How a frame loses markers.
#[derive(Clone, Copy)]
enum Thinning {
    Random,
    OnLine,
    CloseTogether,
}

/// Keeps four to eight markers.
fn thin(markers: &mut Vec<MarkerObservation>, target: &Target, how: Thinning, rng: &mut ChaCha8Rng) {
    let count = rng.random_range(4..=8);
    let [x, y] = target.point(markers[rng.random_range(0..markers.len())].index);
    markers.shuffle(rng);
    match how {
        Thinning::Random => {}
        Thinning::OnLine => markers.retain(|m| (target.point(m.index)[0] - x).abs() < 1e-6 * target.spacing_mm),
        Thinning::CloseTogether => {
            let distance = |m: &MarkerObservation| {
                let p = target.point(m.index);
                (p[0] - x).hypot(p[1] - y)
            };
            markers.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
        }
    }
    markers.truncate(count);
}

fn make_hard(capture: &mut CameraFrames, hardness: Hardness, seed: u64) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let unit_mm = capture.depth_unit_mm.unwrap_or(1.0);
    for (i, frame) in capture.frames.iter_mut().enumerate() {
        if hardness.thinned && i % 3 == 0 && !frame.markers.is_empty() {
            let how = [Thinning::Random, Thinning::OnLine, Thinning::CloseTogether][i / 3 % 3];
            thin(&mut frame.markers, &capture.target, how, &mut rng);
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

/// Result of the fit of a capture: whether all parameters are within three standard deviations, and the frames left out.
struct Outcome {
    within: bool,
    dropped: usize,
}

fn run(seed: u64, hardness: Hardness, lens: &str, folds: usize) -> Result<Outcome, Box<dyn Error + Send + Sync>> {
    let camera = CameraTruth::published(1 + (seed % 4) as usize)?;
    let observed = Simulation::new(camera, Kind::General(1), &[], seed).observe_points(&PointOptions::default())?;
    let mut capture = simulated::capture(&observed);
    make_hard(&mut capture, hardness, seed);
    let options = CameraOptions { lens: lens.to_owned(), ..CameraOptions::default() };
    let result = calibrate_camera(&capture, &options)?;
    if folds > 1 {
        cross_validate_camera(&result, folds, Parts::Interleaved, &options)?;
    }
    let truth = simulated::true_theta(&camera);
    let theta = result.camera.theta();
    let stds = result.std_devs();
    let errors = (0..theta.len()).map(|i| stds[i].map_or(0.0, |s| (theta[i] - truth[i]).abs() / s));
    let worst = errors.fold(0.0, f64::max);
    let within = worst <= 3.0;
    if !within {
        let order = result.lens_choice.as_ref().map_or("not chosen".to_owned(), |c| c.order.to_string());
        eprintln!("{} {seed}: {worst:.1} standard deviations, lens {order}", hardness.name);
    }
    Ok(Outcome { within, dropped: result.capture.dropped.len() })
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let value = |key: &str, default: &str| {
        let key = arguments.iter().position(|a| a == key);
        key.and_then(|i| arguments.get(i + 1)).cloned().unwrap_or_else(|| default.to_owned())
    };
    let captures: u64 = value("--captures", "200").parse().unwrap_or(200);
    let lens = value("--lens", "brown-conrady");
    let folds = value("--folds", "0").parse().unwrap_or(0);
    let most_hard = value("--rows", "4").parse().unwrap_or(TABLE.len());
    println!("{:16} {:>10} {:>16} {:>15} {:>6}", "captures", "calibrated", "within 3 std.", "frames dropped", "s");
    for hardness in TABLE.into_iter().take(most_hard) {
        let start = Instant::now();
        let runs: Vec<Outcome> = (0..captures)
            .into_par_iter()
            .filter_map(|seed| {
                run(seed, hardness, &lens, folds).inspect_err(|e| eprintln!("{} {seed}: {e}", hardness.name)).ok()
            })
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
