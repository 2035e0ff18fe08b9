//! Rigs by points, over many seeds, against their truth.
//!
//!     cargo run --release -p depthcal-studies --bin rig_study -- colour [SEEDS]
//!     cargo run --release -p depthcal-studies --bin rig_study -- depth [SEEDS]
//!     cargo run --release -p depthcal-studies --bin rig_study -- clouds [SEEDS] [CAMERAS] [FRAMES]
//!     cargo run --release -p depthcal-studies --bin rig_study -- offset [SEEDS]
//!     cargo run --release -p depthcal-studies --bin rig_study -- open [SEEDS]
//!     cargo run --release -p depthcal-studies --bin rig_study -- cost [FRAMES]
//!
//! `colour`: infrared, depth and colour; `depth`: infrared with depth, and a second depth camera whose image cannot be had. How
//! often parameters come back within three standard deviations, the normalised squared error, and transfer errors against those
//! of the true rig.
//! `clouds`: several depth cameras around one board, captured in so many frames, and by how much their clouds of the board miss
//! each other. `offset`: a colour camera that exposes later, before a board that is waved. `open`: whether what boards at one
//! distance leave open is named. `cost`: time of a rig of two cameras over that of one.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program that prints")]

use std::error::Error;
use std::time::Instant;

use depthcal_calibration::calibrate::{CalibrateOptions, Calibrated, calibrate};
use depthcal_calibration::calibrate::{CameraOptions, calibrate_camera};
use depthcal_calibration::judge::evaluate::evaluate;
use depthcal_calibration::observe::{Capture, PlacedCamera};
use depthcal_calibration::rig_simulated::{errors, pose, rig_capture, squared_error, true_cameras};
use depthcal_model::{Camera, Register};
use depthcal_simulate::{Kind, PointOptions, Pose, RigCamera, RigPoints, RigSimulation, RigTruth, Waved};
use depthcal_statistics::{chi_squared_tail, rms};
use nalgebra::{Point3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn observe(names: &[String], kind: Kind, seed: u64, frames: Option<usize>) -> Result<RigPoints, Box<dyn Error>> {
    let mut cameras = Vec::new();
    for name in names {
        cameras.push(RigCamera::usual(name, 1)?.ok_or("a camera without a usual form")?);
    }
    let rig = RigSimulation::new(cameras, kind, seed);
    let rig = frames.map_or(rig.clone(), |frames| rig.frames(frames));
    Ok(rig.observe_points(&PointOptions::default())?)
}

fn options(lens: Option<&str>) -> CalibrateOptions {
    CalibrateOptions { lens: lens.map(str::to_owned), ..CalibrateOptions::default() }
}

/// The fit of a simulated rig; says why there is none.
fn fitted(seed: u64, points: &RigPoints, options: &CalibrateOptions) -> Option<Calibrated> {
    calibrate(&rig_capture(points), options).inspect_err(|error| println!("seed {seed}: {error}")).ok()
}

/// Probability of a squared error as large, below which a seed is named: its fit has not come back to the truth.
const LOST: f64 = 1e-6;

fn coverage(names: &[String], seeds: u64, lens: Option<&str>) -> Result<(), Box<dyn Error>> {
    let register = Register::builtin();
    let options = options(lens);
    let mut counts: Vec<(String, usize, usize)> = Vec::new();
    let (mut squared, mut freedom, mut in_interval, mut failed, mut open) = (0.0, 0, 0, 0, 0);
    let mut ratios: Vec<Vec<f64>> = Vec::new();
    for seed in 0..seeds {
        let points = observe(names, Kind::General(1), seed, None)?;
        let Some(fit) = fitted(seed, &points, &options) else {
            failed += 1;
            continue;
        };
        open += usize::from(fit.cameras.iter().any(|c| !c.left_open.is_empty()));
        let parameters = fit.parameters();
        let errors = errors(&fit, &points.truth);
        for (row, error) in &errors {
            let name = &parameters[*row].0;
            let within = usize::from(error.abs() <= 3.0 * fit.std_dev(*row));
            match counts.iter_mut().find(|c| c.0 == *name) {
                Some(count) => (count.1, count.2) = (count.1 + within, count.2 + 1),
                None => counts.push((name.clone(), within, 1)),
            }
        }
        let (value, n) = squared_error(&fit, &errors).ok_or("singular covariance")?;
        let tail = chi_squared_tail(value, n);
        in_interval += usize::from((0.025..=0.975).contains(&tail));
        if tail < LOST {
            println!("seed {seed}: normalised squared error {:.3e} per degree of freedom", value / n as f64);
        }
        squared += value;
        freedom += n;
        let held_out = observe(names, Kind::General(2), seed, None)?;
        let capture = rig_capture(&held_out);
        let ours = evaluate(&fit.placed(), &capture);
        let oracle = evaluate(&true_cameras(&held_out.truth, &register)?, &capture);
        for (a, b) in ours.transfers.iter().zip(&oracle.transfers) {
            for (bin, (a, b)) in a.by_distance().iter().zip(b.by_distance()).enumerate() {
                ratios.resize(ratios.len().max(bin + 1), Vec::new());
                ratios[bin].push(a.rms_mm / b.rms_mm);
            }
        }
    }
    println!("{seeds} seeds, {failed} without a fit, {open} with parameters left open");
    for (name, within, all) in &counts {
        println!("{name:36} {within} of {all} within three standard deviations");
    }
    let (within, all) = counts.iter().fold((0, 0), |s, c| (s.0 + c.1, s.1 + c.2));
    println!("all: {:.2} %", 100.0 * within as f64 / all as f64);
    let off = (squared - freedom as f64) / (2.0 * freedom as f64).sqrt();
    let per = squared / freedom as f64;
    println!("normalised squared error {per:.4} per degree of freedom ({off:+.2} of its own deviations)");
    println!("seeds within their 95 % interval: {in_interval} of {}", seeds - failed);
    for (bin, ratios) in ratios.iter().enumerate() {
        let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
        let most = ratios.iter().copied().fold(0.0, f64::max);
        println!("transfer error over the oracle's, range {}: mean {mean:.4}, largest {most:.4}", bin + 1);
    }
    Ok(())
}

/// Mean distance of every camera's corrected cloud from the true board in a frame, mm, by camera; NaN where it has none.
fn cloud_means(rig: &[PlacedCamera], capture: &Capture, truth: &RigTruth, frame: usize) -> Vec<f64> {
    let of_frame = &truth.cameras[0].truth.frames[frame];
    let rig_from_board = pose(&of_frame.pose);
    let mean = |(placed, own): (&PlacedCamera, &depthcal_calibration::observe::CameraCapture)| {
        let Some(frame) = own.capture.frames.iter().find(|f| f.name == of_frame.name) else { return f64::NAN };
        let heights = frame.depth_pixels().iter().filter_map(|p| {
            let (ray, rho) = placed.camera.correct(&p.context, 1.0, 1.0 / p.depth_mm).ok()?;
            let point = Vector3::new(ray[0], ray[1], 1.0) / rho;
            let in_rig = Point3::from(placed.in_rig([point.x, point.y, point.z]));
            Some((rig_from_board.inverse() * in_rig).z)
        });
        let heights: Vec<f64> = heights.collect();
        heights.iter().sum::<f64>() / heights.len() as f64
    };
    rig.iter().zip(&capture.cameras).map(mean).collect()
}

fn clouds(seeds: u64, cameras: usize, frames: Option<usize>) -> Result<(), Box<dyn Error>> {
    let names: Vec<String> =
        (1..=cameras).map(|n| if n == 1 { "infrared".to_owned() } else { format!("infrared{n}") }).collect();
    let register = Register::builtin();
    let options = options(Some("brown-conrady:full"));
    let (mut ours, mut oracle) = (Vec::new(), Vec::new());
    for seed in 0..seeds {
        let fit = calibrate(&rig_capture(&observe(&names, Kind::General(1), seed, frames)?), &options)?;
        let held_out = observe(&names, Kind::General(2), seed, None)?;
        let capture = rig_capture(&held_out);
        let truth = true_cameras(&held_out.truth, &register)?;
        for frame in 0..held_out.truth.cameras[0].truth.frames.len() {
            for (rig, gaps) in [(&fit.placed(), &mut ours), (&truth, &mut oracle)] {
                let means = cloud_means(rig, &capture, &held_out.truth, frame);
                let pairs = (0..means.len()).flat_map(|b| (0..b).map(move |a| (a, b)));
                gaps.extend(pairs.map(|(a, b)| means[b] - means[a]).filter(|gap| gap.is_finite()));
            }
        }
    }
    let (ours, truth) = (rms(ours.iter().copied()), rms(oracle.iter().copied()));
    println!("{cameras} cameras, {seeds} seeds, {} gaps between the means of two clouds", oracle.len());
    println!("rms {ours:.4} mm, by noise alone {truth:.4} mm: {:.3} times", ours / truth);
    Ok(())
}

/// Videos of 60 frames, the colour camera 5 ms to 30 ms late or early.
fn offset(seeds: u64) -> Result<(), Box<dyn Error>> {
    let with = CalibrateOptions { time_offsets: vec!["colour".to_owned()], ..options(Some("brown-conrady:full")) };
    let (mut off, mut squared, mut freedom, mut sigmas, mut failed) = (Vec::new(), 0.0, 0, Vec::new(), 0);
    for seed in 0..seeds {
        let offset_s = 0.005 * (1 + seed % 6) as f64 * if seed % 2 == 0 { 1.0 } else { -1.0 };
        let mut cameras = Vec::new();
        for name in ["infrared", "colour"] {
            cameras.push(RigCamera::usual(name, 1)?.ok_or("a camera without a usual form")?);
        }
        cameras[1].time_offset_s = offset_s;
        let rig = RigSimulation::new(cameras, Kind::General(1), seed).waved(Waved::default(), 60);
        let points = rig.observe_points(&PointOptions::default())?;
        let Some(fit) = fitted(seed, &points, &with) else {
            failed += 1;
            continue;
        };
        let offset = fit.cameras[1].time_offset.ok_or("no offset")?;
        off.push((offset.value_s - offset_s) / offset.std_dev_s);
        sigmas.push(1e3 * offset.std_dev_s);
        let (value, n) = squared_error(&fit, &errors(&fit, &points.truth)).ok_or("singular covariance")?;
        squared += value;
        freedom += n;
    }
    let within = off.iter().filter(|d| d.abs() <= 3.0).count();
    println!("{seeds} seeds, {failed} without a fit; offsets known to {:.3} ms", rms(sigmas));
    println!(
        "{within} of {} offsets within three standard deviations, rms {:.2} of them",
        off.len(),
        rms(off.iter().copied())
    );
    println!("normalised squared error {:.3} per degree of freedom", squared / freedom as f64);
    Ok(())
}

/// A depth camera without images whose boards are at one distance with tilts of at most 8°, which leave its pinhole to the prior,
/// and the usual captures, which leave nothing: how often the output names what is left open, and names anything where nothing
/// is.
fn left_open(seeds: u64) -> Result<(), Box<dyn Error>> {
    let named = |seed: u64, poses: Option<Vec<Pose>>| -> Result<Vec<String>, Box<dyn Error>> {
        let cameras = ["infrared", "depth"].map(|name| RigCamera::usual(name, 1).ok().flatten());
        let cameras = cameras.into_iter().collect::<Option<Vec<_>>>().ok_or("a camera without a usual form")?;
        let rig = RigSimulation::new(cameras, Kind::General(1), seed);
        let rig = poses.map_or(rig.clone(), |poses| rig.poses(poses));
        let mut capture = rig_capture(&rig.observe_points(&PointOptions::default())?);
        capture.cameras[1].declared = Some(Camera::new(512, 424, [365.0, 365.0, 258.0, 208.0, 0.0], vec![]));
        let fit = calibrate(&capture, &options(None))?;
        Ok(fit.camera("depth").ok_or("no camera")?.left_open.iter().map(|open| open.parameter.clone()).collect())
    };
    let (mut true_names, mut false_names, mut failed) = (0, 0, 0);
    let mut random = ChaCha8Rng::seed_from_u64(5);
    for seed in 0..seeds {
        let (distance_mm, tilt) = (random.random_range(600.0..1400.0), random.random_range(0.03..0.14));
        let centre = Pose::from_rotation_vector([0.0; 3], [-40.0, -85.0, 0.0]);
        let poses: Vec<Pose> = (0..14)
            .map(|_| {
                let mut within = |size: f64| random.random_range(-size..size);
                let turn = [within(tilt), within(tilt), within(3.0)];
                let place = [within(60.0), within(40.0), distance_mm * (1.0 + within(0.03))];
                Pose::from_rotation_vector(turn, place).after(&centre)
            })
            .collect();
        match (named(seed, Some(poses)), named(seed, None)) {
            (Ok(narrow), Ok(wide)) => {
                let pinhole = ["pinhole.fx", "pinhole.fy", "pinhole.cx", "pinhole.cy"];
                true_names += pinhole.iter().filter(|name| narrow.iter().any(|open| open == *name)).count();
                false_names += wide.len();
            }
            (narrow, wide) => {
                println!("seed {seed}: {}", narrow.err().or(wide.err()).map(|e| e.to_string()).unwrap_or_default());
                failed += 1;
            }
        }
    }
    println!("{seeds} seeds, {failed} without a fit");
    println!("{true_names} of {} parameters that are left open are named", 4 * (seeds - failed));
    println!("{false_names} are named where boards at all distances and tilts leave none open");
    Ok(())
}

fn cost(frames: usize) -> Result<(), Box<dyn Error>> {
    let names = ["infrared".to_owned(), "infrared2".to_owned()];
    let points = observe(&names, Kind::General(1), 1, Some(frames))?;
    let capture = rig_capture(&points);
    let one = CameraOptions { lens: "brown-conrady:full".to_owned(), ..CameraOptions::default() };
    let both = options(Some("brown-conrady:full"));
    let least = |run: &dyn Fn() -> Result<(), Box<dyn Error>>| -> Result<f64, Box<dyn Error>> {
        let mut least = f64::INFINITY;
        for _ in 0..5 {
            let start = Instant::now();
            run()?;
            least = least.min(start.elapsed().as_secs_f64());
        }
        Ok(least)
    };
    let single = least(&|| Ok(calibrate_camera(&capture.cameras[0].capture, &one).map(drop)?))?;
    let rig = least(&|| Ok(calibrate(&capture, &both).map(drop)?))?;
    println!("{frames} frames: one camera {single:.3} s, two cameras {rig:.3} s: {:.2} times", rig / single);
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let number = |i: usize, default: u64| words.get(i).map_or(Ok(default), |text| text.parse());
    let named = |names: [&str; 2]| names.map(str::to_owned).to_vec();
    match words.first().map(String::as_str) {
        Some("colour") => coverage(&named(["infrared", "colour"]), number(1, 100)?, Some("brown-conrady:full")),
        Some("depth") => coverage(&named(["infrared", "depth"]), number(1, 100)?, None),
        Some("clouds") => clouds(number(1, 20)?, number(2, 2)? as usize, words.get(3).map(|n| n.parse()).transpose()?),
        Some("offset") => offset(number(1, 40)?),
        Some("open") => left_open(number(1, 50)?),
        Some("cost") => cost(number(1, 30)? as usize),
        _ => Err("say colour, depth, clouds, offset, open or cost".into()),
    }
}
