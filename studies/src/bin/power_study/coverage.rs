//! Whether 95 % intervals hold the truth in 95 % of captures: those of the parameters, and that of the reported error.

use depthcal::calibration::calibrate::{CameraOptions, calibrate_camera};
use depthcal::calibration::diagnose::CameraDiagnoseOptions;
use depthcal::calibration::judge::camera::evaluate_camera;
use depthcal::calibration::judge::cross_validation::{cross_validate_camera, errors};
use depthcal::calibration::judge::intervals::depth_rms;
use depthcal::calibration::judge::parts::Parts;
use depthcal::calibration::observe::CameraFrames;
use depthcal::calibration::simulated;
use depthcal_simulate::{CameraTruth, DepthNoise, Kind, Noise, PointOptions, Simulation};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use rayon::prelude::*;

use super::{Failure, Study};

/// Standard deviations of an interval that holds 95 %.
const SIGMAS: f64 = 1.96;
/// Frames of the capture that says what the error really is.
const FRAMES_OF_TRUTH: usize = 1000;
/// Size of frames' own planes in inverse depth at the middle of the image, and per unit of the ray, 1/mm: some 1 mm at a metre.
const OWN_PLANE: [f64; 2] = [1e-6, 4e-6];

/// Parameters within their interval, parameters, and whether the true error is within that of the reported one.
type Run = (usize, usize, bool);

impl Study {
    /// One capture per seed, without and with planes of the frames' own.
    pub fn coverage(&self) {
        println!("| frames' own planes | captures | parameters | reported depth error |");
        println!("|---|---|---|---|");
        for has_planes in [false, true] {
            let runs: Vec<Run> = self
                .numbers()
                .into_par_iter()
                .filter_map(|seed| run(seed, has_planes).inspect_err(|e| eprintln!("coverage {seed}: {e}")).ok())
                .collect();
            let (within, all) = runs.iter().fold((0, 0), |s, r| (s.0 + r.0, s.1 + r.1));
            let errors = runs.iter().filter(|r| r.2).count();
            let planes = if has_planes { "on" } else { "off" };
            let [parameters, errors] = [(within, all), (errors, runs.len())]
                .map(|(n, of)| format!("{:.1} %", 100.0 * n as f64 / of.max(1) as f64));
            println!("| {planes} | {} | {parameters} | {errors} |", runs.len());
        }
    }
}

/// A capture by a drawn camera with drawn noise; frames with their own planes where wanted.
fn capture(seed: u64, frames: usize, session: u64, has_planes: bool) -> Result<(CameraFrames, CameraTruth), Failure> {
    let mut rng = ChaCha8Rng::seed_from_u64(11_000 + seed);
    let camera = CameraTruth::published(rng.random_range(1..=4))?;
    let depth = match rng.random_bool(0.5) {
        true => DepthNoise::Disparity { sigma_rho: 10f64.powf(rng.random_range(-6.2..-5.4)) },
        false => DepthNoise::TimeOfFlight { sigma_mm: 10f64.powf(rng.random_range(-0.2..0.6)) },
    };
    let noise = Noise { depth, ..Noise::default() };
    let simulation = Simulation::new(camera, Kind::General(1), &[], 5000 * session + seed).frames(frames).noise(noise);
    let mut capture = simulated::capture(&simulation.observe_points(&PointOptions::default())?);
    if has_planes {
        let mut rng = ChaCha8Rng::seed_from_u64(50_000 * session + seed);
        for frame in &mut capture.frames {
            let [a, b, c] =
                [OWN_PLANE[0], OWN_PLANE[1], OWN_PLANE[1]].map(|s| s * rng.sample::<f64, _>(StandardNormal));
            for pixel in frame.raw.depth_pixels_mut() {
                let [u, v] = pixel.context.pixel;
                let [x, y] =
                    [(u - camera.centre_px[0]) / camera.focal_px[0], (v - camera.centre_px[1]) / camera.focal_px[1]];
                pixel.depth_mm = 1.0 / (1.0 / pixel.depth_mm + a + b * x + c * y);
            }
        }
    }
    Ok((capture, camera))
}

fn run(seed: u64, has_planes: bool) -> Result<Run, Failure> {
    let (observed, camera) = capture(seed, 30, 1, has_planes)?;
    let options = CameraOptions::default();
    let fit = calibrate_camera(&observed, &options)?;
    let z = fit.camera.theta().into_iter().zip(simulated::true_theta(&camera)).zip(fit.std_devs());
    let z: Vec<f64> = z.filter_map(|((found, truth), std)| Some((found - truth).abs() / std?)).collect();
    let within = z.iter().filter(|z| **z < SIGMAS).count();
    let judged = cross_validate_camera(&fit, CameraDiagnoseOptions::default().folds, Parts::Interleaved, &options)?;
    let interval = depth_rms(judged.frames.iter()).and_then(|change| change.after_interval()).ok_or("no interval")?;
    let truth = errors(&evaluate_camera(&fit.camera, &capture(seed, FRAMES_OF_TRUTH, 2, has_planes)?.0));
    let truth = truth.depth_rms_mm.ok_or("no depth")?;
    let holds = interval.low <= truth && truth <= interval.high;
    eprintln!(
        "coverage {seed} planes {has_planes}: {within} of {} parameters, {interval:.3?} holds {truth:.3}: {holds}",
        z.len()
    );
    Ok((within, z.len(), holds))
}
