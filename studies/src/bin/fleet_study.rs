//! Fleets of simulated units: a shared effect that no unit shows alone, how many frames a prior saves, and outliers.
//!
//! `cargo run --release -p depthcal-studies --bin fleet_study -- [shared] [prior] [outliers] [--repeats N]`; without words, all
//! three.
//!
//! Units are cameras whose pinhole, lens and depth distortion scatter about those of a published camera. Captures are simulated
//! as points: markers and depths with noise, without images. The simulator shares no code with the pieces that are fitted.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program that prints")]

use std::error::Error;
use std::sync::Arc;

use depthcal::calibration::adjust::camera_prior::CameraPrior;
use depthcal::calibration::calibrate::{CalibratedCamera, CameraOptions, calibrate_camera};
use depthcal::calibration::diagnose::Thresholds;
use depthcal::calibration::diagnose::effect_scores::effect_scores;
use depthcal::calibration::observe::CameraFrames;
use depthcal::calibration::simulated;
use depthcal::fleet::{FleetOptions, Joined, Unit, join};
use depthcal::io::{CAMERA, FileReference, FleetEffectUnit, Prior};
use depthcal::model::Register;
use depthcal::{Calibrated, calibration_record, evaluate_camera, evaluate_fitted};
use depthcal_simulate::{CameraTruth, Effect, Kind, Noise, PointOptions, Simulation};
use depthcal_statistics::{chi_squared_tail, noncentrality};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;

type Failure = Box<dyn Error + Send + Sync>;

/// Units of a fleet.
const UNITS: usize = 24;
/// Frames of a unit's capture.
const FRAMES: usize = 24;
/// Frames of the capture that says what the error of a camera really is.
const FRAMES_OF_TRUTH: usize = 60;
/// Most frames of the next unit.
const MOST_FRAMES: usize = 24;
/// The shared effect, its catalogue name in simulator and model.
const SHARED: &str = "range_offset";
/// Scatter between units: focal lengths and principal point, px; lens k1 k2 p1 p2 k3; dx dy dz, 1/mm; dw.
const FOCAL_PX: f64 = 1.5;
const CENTRE_PX: f64 = 2.5;
const LENS: [f64; 5] = [4e-3, 8e-3, 3e-4, 3e-4, 8e-3];
const DEPTH: [f64; 4] = [8e-6, 8e-6, 6e-6, 4e-3];
/// Factors by which planted outliers exceed the scatter: in the focal lengths of one unit, in dw of another.
const OUTLYING: f64 = 10.0;

/// A camera of the type: every parameter scatters on its own.
fn camera(rng: &mut ChaCha8Rng) -> Result<CameraTruth, Failure> {
    let mut draw = || -> f64 { StandardNormal.sample(rng) };
    let mut camera = CameraTruth::published(1)?;
    let focal = FOCAL_PX * draw();
    // The two focal lengths are those of one lens.
    camera.focal_px = camera.focal_px.map(|f| f + focal);
    camera.centre_px = [camera.centre_px[0] + CENTRE_PX * draw(), camera.centre_px[1] + CENTRE_PX * draw()];
    for (k, std) in camera.lens.iter_mut().zip(LENS) {
        *k += std * draw();
    }
    for (d, std) in camera.depth.iter_mut().zip(DEPTH) {
        *d += std * draw();
    }
    Ok(camera)
}

fn capture(camera: CameraTruth, effects: &[Effect], frames: usize, seed: u64) -> Result<CameraFrames, Failure> {
    let simulation = Simulation::new(camera, Kind::General(1), effects, seed).frames(frames);
    Ok(simulated::capture(&simulation.observe_points(&PointOptions::default())?))
}

/// A unit as its files would say it.
fn unit(name: &str, fit: &CalibratedCamera) -> Result<Unit, Failure> {
    let register = Register::builtin();
    let dataset = FileReference { path: name.to_owned(), digest: name.to_owned() };
    let alone = Calibrated::of_camera(CAMERA, fit.clone());
    let record = calibration_record(&alone, &evaluate_fitted(&alone), dataset.clone(), None);
    let scores = effect_scores(fit, &register, dataset)?;
    Unit::new(name, name, &record, scores.as_ref(), &register).ok_or_else(|| "a unit without covariance".into())
}

/// Units of a fleet have the same terms of the lens, whatever the frames of one determine.
fn same_lens() -> CameraOptions {
    CameraOptions { lens: "brown-conrady:full".to_owned(), ..CameraOptions::default() }
}

/// Fleet number `fleet`: its cameras, drawn anew, and what they say together.
fn fleet(fleet: u64, effects: &[Effect], change: impl Fn(usize, &mut CameraTruth) + Sync) -> Result<Joined, Failure> {
    let units: Result<Vec<Unit>, Failure> = (0..UNITS)
        .into_par_iter()
        .map(|i| {
            let seed = 1000 * fleet + i as u64;
            let mut truth = camera(&mut ChaCha8Rng::seed_from_u64(seed))?;
            change(i, &mut truth);
            let fit = calibrate_camera(&capture(truth, effects, FRAMES, 77_000 + seed)?, &same_lens())?;
            unit(&format!("unit{i:02}"), &fit)
        })
        .collect();
    Ok(join(units?, Vec::new(), &FleetOptions::default())?)
}

/// Size of the shared effect that one unit detects with 80 % power at the 1 % level, in the simulator's unit, which is that of
/// the effect's only parameter: from the information that a unit without the effect has on it. A unit with an effect so large
/// that its score can be measured will not do: what the effect leaves in the residuals is then taken for noise.
fn detectable_size() -> Result<f64, Failure> {
    let thresholds = Thresholds::default();
    let fit = calibrate_camera(&capture(CameraTruth::published(1)?, &[], FRAMES, 5)?, &same_lens())?;
    let scores = effect_scores(&fit, &Register::builtin(), FileReference::default())?.ok_or("no scores")?;
    let effect = scores.effects.iter().position(|e| e.effect == SHARED).ok_or("the effect is not scored")?;
    let column: usize = scores.effects[..effect].iter().map(|e| e.parameters.len()).sum();
    let sufficient = noncentrality(1, thresholds.level / scores.effects.len() as f64, thresholds.power);
    Ok((sufficient / scores.information[column][column]).sqrt())
}

/// Fleets without an effect, and with a shared one at a quarter and at half of what one unit detects; the last with two planted
/// outliers.
fn shared(repeats: u64) -> Result<(), Failure> {
    let size = detectable_size()?;
    println!(
        "\n{SHARED} of {size:.3} (simulator's unit) is what one unit of {FRAMES} frames detects with 80 % power.\n"
    );
    println!(
        "| size, of the detectable one | fleets | units that show it alone, median | found as shared | another found as well | another in its place | p, median | size found / true, median | outliers planted | found | in the planted parameter | falsely |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|");
    for (factor, planted) in [(0.0, false), (0.25, false), (0.5, true)] {
        let (mut detected, mut others, mut instead) = (0, 0, 0);
        let (mut p, mut sizes, mut alone) = (Vec::new(), Vec::new(), Vec::new());
        let mut outliers = Outliers::default();
        for repeat in 0..repeats {
            let effects = if factor > 0.0 { vec![Effect::new(SHARED, factor * size)?] } else { Vec::new() };
            let joined = fleet(10 + repeat, &effects, |i, camera| {
                if planted {
                    plant(i, camera);
                }
            })?;
            outliers.add(&joined, planted);
            let named: Vec<&str> =
                joined.fleet.effects.iter().filter(|e| e.shared).map(|e| e.effect.as_str()).collect();
            let (has_it, has_another) = (named.contains(&SHARED), named.iter().any(|n| *n != SHARED));
            detected += usize::from(has_it);
            others += usize::from(has_it && has_another);
            instead += usize::from(!has_it && has_another);
            if let Some(e) = joined.fleet.effects.iter().find(|e| e.effect == SHARED) {
                p.push(e.shared_p_value);
                sizes.push(e.mean[0] / (factor * size));
                let tests = joined.fleet.effects.len() as f64;
                let shows = |u: &&FleetEffectUnit| {
                    chi_squared_tail((u.values[0] / u.std_dev[0]).powi(2), 1) * tests < Thresholds::default().level
                };
                alone.push(e.units.iter().filter(shows).count() as f64);
            }
            eprintln!("shared {factor} fleet {repeat}: {named:?} {:?}", p.last());
            for e in joined.fleet.effects.iter().take(6) {
                eprintln!(
                    "    {} p {:.1e} differs {:.1e} overdispersion {:.2} of detectable {:.2?} explained by {:?} not told apart {:?}",
                    e.effect,
                    e.shared_p_value,
                    e.differs_p_value,
                    e.overdispersion,
                    e.of_detectable,
                    e.explained_by,
                    e.indistinguishable
                );
            }
        }
        println!(
            "| {factor} | {repeats} | {} | {detected} | {others} | {instead} | {:.1e} | {:.2} | {} |",
            median(&mut alone),
            median(&mut p),
            median(&mut sizes),
            outliers.columns(if planted { 2 * repeats } else { 0 })
        );
    }
    Ok(())
}

/// Makes two units of a fleet unlike the others.
fn plant(unit: usize, camera: &mut CameraTruth) {
    match unit {
        7 => camera.focal_px = camera.focal_px.map(|f| f + OUTLYING * FOCAL_PX),
        15 => camera.depth[3] += OUTLYING * DEPTH[3],
        _ => {}
    }
}

/// Outliers that were found.
#[derive(Default)]
struct Outliers {
    found: usize,
    /// Of these, in the planted parameter.
    right: usize,
    falsely: usize,
}

impl Outliers {
    fn add(&mut self, joined: &Joined, planted: bool) {
        for outlier in &joined.fleet.outliers {
            let first = outlier.parts.first().map_or("", |p| p.parameter.as_str());
            match outlier.unit {
                7 | 15 if planted && outlier.within == "model" => {
                    self.found += 1;
                    let expected: &[&str] =
                        if outlier.unit == 7 { &["pinhole.fx", "pinhole.fy"] } else { &["projective.dw"] };
                    self.right += usize::from(expected.contains(&first));
                }
                7 | 15 if planted => {}
                _ => self.falsely += 1,
            }
            eprintln!("  outlier {} in {} {first} p {:.1e}", outlier.name, outlier.within, outlier.p_value);
        }
    }

    fn columns(&self, planted: u64) -> String {
        format!("{planted} | {} | {} | {}", self.found, self.right, self.falsely)
    }
}

/// Root mean square error of depth and of markers without noise, of a camera that was fitted: what its parameters do.
fn true_error(fit: &CalibratedCamera, truth: CameraTruth, seed: u64) -> Result<[f64; 2], Failure> {
    let options = PointOptions { sigma_px: 0.0, ..PointOptions::default() };
    let simulation = Simulation::new(truth, Kind::General(1), &[], seed).frames(FRAMES_OF_TRUTH).noise(Noise::none());
    let judged = evaluate_camera(&fit.camera, &simulated::capture(&simulation.observe_points(&options)?)).record();
    let depth = judged.depth_rms_mm.ok_or("no depth")?.after;
    Ok([depth, judged.dot_error_mm.ok_or("no markers")?.after.mean])
}

/// Error against the number of frames, without and with the prior of a fleet.
fn prior(repeats: u64) -> Result<(), Failure> {
    let joined = fleet(1, &[], |_, _| {})?;
    let prior = Arc::new(CameraPrior::from(&joined.prior));
    println!("\n{}", described(&joined.prior));
    println!(
        "\n| frames | without prior: depth rms, mm | dot error, mm | failed | with prior: depth rms, mm | dot error, mm | failed |"
    );
    println!("|---|---|---|---|---|---|---|");
    for frames in [2, 3, 4, 5, 6, 8, 10, 12, 16, 20, MOST_FRAMES] {
        let run = |repeat: u64, with: bool| -> Result<[f64; 2], Failure> {
            let seed = 500_000 + repeat;
            let truth = camera(&mut ChaCha8Rng::seed_from_u64(seed))?;
            let prior = with.then(|| prior.clone());
            let options = CameraOptions { prior, ..CameraOptions::default() };
            // The first frames of one capture, so that errors of different numbers of frames can be compared.
            let all = capture(truth, &[], MOST_FRAMES, 900_000 + repeat)?;
            let fit = calibrate_camera(&all.subset(|i, _| i < frames), &options)?;
            true_error(&fit, truth, 3_000_000 + repeat)
        };
        let column = |with: bool| {
            let runs: Vec<Option<[f64; 2]>> = (0..repeats)
                .into_par_iter()
                .map(|repeat| run(repeat, with).inspect_err(|e| eprintln!("{frames} frames, {with}: {e}")).ok())
                .collect();
            let failed = runs.iter().filter(|r| r.is_none()).count();
            let rms_error = |i: usize| {
                let squares: Vec<f64> = runs.iter().flatten().map(|r| r[i] * r[i]).collect();
                (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
            };
            format!("{:.3} | {:.3} | {failed}", rms_error(0), rms_error(1))
        };
        println!("| {frames} | {} | {} |", column(false), column(true));
    }
    Ok(())
}

fn described(prior: &Prior) -> String {
    let parts = prior.parameters.iter().zip(&prior.mean).enumerate();
    let text: Vec<String> =
        parts.map(|(k, (name, mean))| format!("{name} {mean:.4e} ± {:.1e}", prior.covariance[k][k].sqrt())).collect();
    format!("Prior of {} units: {}", prior.units, text.join(", "))
}

/// Two planted outliers, and fleets without any.
fn outliers(repeats: u64) -> Result<(), Failure> {
    println!("\n| fleets | planted | found | in the planted parameter | falsely |");
    println!("|---|---|---|---|---|");
    for planted in [true, false] {
        let mut outliers = Outliers::default();
        for repeat in 0..repeats {
            let joined = fleet(200 + repeat, &[], |i, camera| {
                if planted {
                    plant(i, camera);
                }
            })?;
            outliers.add(&joined, planted);
        }
        println!("| {repeats} | {} |", outliers.columns(if planted { 2 * repeats } else { 0 }));
    }
    Ok(())
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let repeats = match arguments.iter().position(|a| a == "--repeats") {
        Some(option) => arguments.get(option + 1).ok_or("--repeats needs a number")?.parse()?,
        None => 10,
    };
    let wants = |what: &str| {
        arguments.iter().all(|a| a.starts_with("--") || a.parse::<u64>().is_ok()) || arguments.iter().any(|a| a == what)
    };
    if wants("shared") {
        shared(repeats)?;
    }
    if wants("outliers") {
        outliers(repeats)?;
    }
    if wants("prior") {
        prior(repeats)?;
    }
    Ok(())
}
