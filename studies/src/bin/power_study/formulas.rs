//! Formulas that are found for functions that are in no library.

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::TAU;
use std::sync::Arc;

use depthcal::calibration::calibrate::{CameraOptions, calibrate_camera};
use depthcal::calibration::diagnose::{CameraDiagnoseOptions, CameraDiagnosis, Thresholds};
use depthcal::calibration::judge::camera::residual_pixels;
use depthcal::calibration::judge::cross_validation::{cross_validate_thinned, errors};
use depthcal::calibration::judge::depth_errors::PixelError;
use depthcal::calibration::judge::parts::Parts;
use depthcal::calibration::simulated;
use depthcal::io::DiagnosisPlace;
use depthcal::model::{Of, On};
use depthcal_simulate::{Form, GivenEffect, Observation, Place, PointOptions, Simulation, catalogue};
use depthcal_statistics::noncentrality;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::drawn::drawn;
use super::rediscovered::{covariates_found, names_of_catalogue};
use super::{Failure, Study, depth_rms_mm, median, names, percent};

/// Covariates of random functions.
const COVARIATES: [&str; 8] = ["x", "y", "r", "z", "incidence", "amplitude", "timestamp_s", "temperature_c"];
/// Size at which random functions are first tried, mm root mean square over the usual ranges.
const FIRST_SIZE_MM: f64 = 3.0;
/// Number of parameters with which a function is thought to be described, for the size that a capture can show.
const RANK: usize = 2;
/// Squared deviation that is smaller, in squares of the noise, shows that the other parameters take a function up whole.
const LEAST_SEEN: f64 = 1e-3;
/// Values of a covariate, in groups of equally many pixels, between which a free function of it may change.
const STEPS: usize = 24;
/// A covariate of a product is visible where what no function of the other one explains is this many times as large as the
/// capture can show.
const VISIBLE: f64 = 2.0;
/// Board pixels of a frame, about, on which errors without the function are judged.
const JUDGED_PIXELS: usize = 16_000;

/// Result of the diagnosis of one capture.
pub(super) struct Run {
    /// Covariates of the formula and of the effects that were named, families merged; `None` where there is neither.
    pub covariates: Option<BTreeSet<&'static str>>,
    /// Whether there is a formula.
    formula: bool,
    confirmed: bool,
    /// Whether place and form are right, or listed as not told apart.
    place: bool,
    pub right: bool,
    /// Whether a covariate was found that has no part in it.
    pub wrong: bool,
    /// Number of covariates of the function, and whether the capture can show each of them.
    kind: (usize, bool),
    /// Names of the catalogue among the steps.
    named: usize,
    /// Held-out error after over that of the same capture without the function.
    ratio: f64,
}

/// Covariates that captures hardly tell apart, as one.
pub(super) fn family(covariate: &str) -> &'static str {
    match covariate {
        "x" | "u" => "x",
        "y" | "v" => "y",
        "r" => "r",
        "z" | "rho" | "range" => "z",
        "amplitude" | "surroundings" => "amplitude",
        "incidence" => "incidence",
        "timestamp_s" => "timestamp_s",
        "temperature_c" => "temperature_c",
        _ => "none",
    }
}

impl Run {
    pub fn new(d: &CameraDiagnosis, truth: &[&str], place: Option<DiagnosisPlace>, ratio: f64) -> Self {
        let covariates = (!d.steps.is_empty()).then(|| covariates_found(d, &names_of_catalogue(d)));
        let truth: BTreeSet<&str> = truth.iter().map(|c| family(c)).collect();
        Self {
            right: covariates.as_ref().is_some_and(|covariates| *covariates == truth),
            wrong: covariates.as_ref().is_some_and(|covariates| !covariates.is_subset(&truth)),
            place: place.is_some_and(|place| {
                d.steps.iter().any(|s| s.place == Some(place) || s.places_not_told_apart.contains(&place))
            }),
            formula: !d.formulas.is_empty(),
            confirmed: d.formulas.iter().all(|f| f.confirmed),
            named: d.steps.len() - d.formulas.len(),
            kind: (truth.len(), true),
            covariates,
            ratio,
        }
    }
}

fn table(title: &str, runs: &[&Run]) {
    let n = runs.len();
    if n == 0 {
        return;
    }
    let count = |is: &dyn Fn(&Run) -> bool| percent(runs.iter().filter(|r| is(r)).count(), n);
    println!(
        "| {title} | {n} | {} | {} | {} | {} | {} | {} | {} | {} | {:.3} |",
        count(&|r| r.right),
        count(&|r| r.place),
        count(&|r| r.covariates.is_some() && !r.right && !r.wrong),
        count(&|r| r.wrong),
        count(&|r| r.formula),
        count(&|r| r.formula && r.confirmed),
        count(&|r| r.named > 0),
        count(&|r| r.ratio <= 1.1),
        median(runs.iter().map(|r| r.ratio).collect()),
    );
}

fn header() {
    println!(
        "| captures with | captures | right covariates | right place and form, or listed | some of them | wrong ones | a formula | it is confirmed | a name of the catalogue | \
         error within 10 % of that without the function | median |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|");
}

impl Study {
    /// Held-out error of a capture under the declared model, mm.
    pub(super) fn error_without(&self, simulation: &Simulation) -> Result<f64, Failure> {
        let options = CameraOptions::default();
        let fit = calibrate_camera(&self.capture(simulation)?, &options)?;
        let folds = CameraDiagnoseOptions::default().folds;
        let evaluated = cross_validate_thinned(&fit, folds, Parts::Interleaved, JUDGED_PIXELS, &options)?;
        Ok(errors(&evaluated).depth_rms_mm.unwrap_or(f64::NAN))
    }

    /// Random functions of one and of two covariates.
    pub fn formulas(&self) {
        header();
        for factor in &self.factors {
            let runs: Vec<Run> = self
                .numbers()
                .into_par_iter()
                .filter_map(|seed| self.random(*factor, seed).inspect_err(|e| eprintln!("formula {seed}: {e}")).ok())
                .collect();
            for (kind, words) in [
                ((1, true), "of one covariate"),
                ((2, true), "of two, both visible"),
                ((2, false), "of two, one of them hidden"),
            ] {
                let of_kind: Vec<&Run> = runs.iter().filter(|run| run.kind == kind).collect();
                table(&format!("{words}, {factor} ×"), &of_kind);
            }
            table(&format!("random functions {factor} ×"), &runs.iter().collect::<Vec<_>>());
        }
    }

    fn random(&self, factor: f64, seed: u64) -> Result<Run, Failure> {
        let with = |size_mm: f64| random_function(&mut ChaCha8Rng::seed_from_u64(31_000 + seed), size_mm);
        let mut size_mm = FIRST_SIZE_MM;
        let mut shows = vec![true];
        for _ in 0..2 {
            let (given, covariates, _) = with(size_mm);
            let seen = Seen::of(given, &covariates, seed)?;
            size_mm *= factor * seen.whole;
            // What the other covariate leaves, at the size that is taken.
            shows = seen.parts.iter().map(|part| VISIBLE * part <= factor * seen.whole).collect();
        }
        let (given, covariates, words) = with(size_mm);
        let on = match given.form {
            Form::Depth => On::Depth,
            Form::Factor => On::Factor,
            Form::InverseDepth => On::InverseDepth,
        };
        let place = DiagnosisPlace { of: if given.place == Place::True { Of::True } else { Of::Measured }, on };
        let d = self.diagnose(&drawn(&[], seed)?.simulation.given([given]))?;
        let pure = self.error_without(&drawn(&[], seed)?.simulation)?;
        let mut run = Run::new(&d, &covariates, Some(place), depth_rms_mm(&d.after) / pure);
        run.kind.1 = shows.iter().all(|shows| *shows);
        log(&format!("formula {seed}: {words} {place:?} shows {shows:?}"), &d, &run);
        Ok(run)
    }
}

pub(super) fn log(what: &str, d: &CameraDiagnosis, run: &Run) {
    let formulas: Vec<String> = d
        .formulas
        .iter()
        .map(|f| format!("{} {:?} {:.2} {}", f.effect.text(), f.place, f.stability, f.confirmed))
        .collect();
    eprintln!(
        "{what}: {:?} {:?} right {} place {} error {:.3} → {:.3}, over that without {:.3}; {:?} refused {:?}",
        d.verdict,
        formulas,
        run.right,
        run.place,
        depth_rms_mm(&d.before),
        depth_rms_mm(&d.after),
        run.ratio,
        names(d),
        d.formula_refused
    );
}

/// The sizes that a capture can just show, over those of a function.
struct Seen {
    /// Of the function.
    whole: f64,
    /// For each covariate of a product: of what the best free function of the other one leaves. None for functions of one.
    parts: Vec<f64>,
}

impl Seen {
    /// By what camera and poses leave of the function when they are fitted jointly: the same capture with and without it, noise
    /// included. What the noise of neighbouring pixels has in common makes the function harder to see: the variance of its score
    /// is that from frame to frame.
    fn of(given: GivenEffect, covariates: &[&'static str], seed: u64) -> Result<Self, Failure> {
        // Planes of whole frames would take up part of the effect.
        let options = CameraOptions { frame_planes: false, ..CameraOptions::default() };
        let fit = |simulation: &Simulation| -> Result<_, Failure> {
            let capture = simulated::capture(&simulation.observe_points(&PointOptions::default())?);
            let fit = calibrate_camera(&capture, &options)?;
            let residuals = residual_pixels(&fit.camera, &fit.capture, |pixels| pixels);
            Ok((fit, residuals))
        };
        let form = given.form;
        let (without, residuals_without) = fit(&drawn(&[], seed)?.simulation)?;
        let (_, residuals_with) = fit(&drawn(&[], seed)?.simulation.given([given]))?;
        let mut pixels = Vec::new();
        for (number, (frame, other)) in residuals_without.iter().zip(&residuals_with).enumerate() {
            let known: BTreeMap<_, f64> =
                other.iter().map(|p| (p.context.pixel.map(f64::to_bits), p.after_mm)).collect();
            for pixel in frame {
                let Some(with) = known.get(&pixel.context.pixel.map(f64::to_bits)) else { continue };
                let rho = 1.0 / pixel.board_depth_mm;
                // Millimetres that 1 of the function is worth at the pixel.
                let mm = match form {
                    Form::Depth => 1.0,
                    Form::Factor => pixel.board_depth_mm,
                    Form::InverseDepth => pixel.board_depth_mm.powi(2),
                };
                let per_mm = rho * rho / without.noise.depth.sigma(rho);
                pixels.push(Change {
                    frame: number,
                    covariates: covariates.iter().map(|c| value(c, pixel, without.camera.pinhole())).collect(),
                    value: (with - pixel.after_mm) / mm,
                    sigmas: per_mm * mm,
                    noise: per_mm * pixel.after_mm,
                });
            }
        }
        let whole = detectable_share(&pixels)?;
        let parts = (0..covariates.len()).filter(|_| covariates.len() == 2).map(|other| {
            let left = without_function_of(1 - other, &pixels);
            detectable_share(&left).unwrap_or(f64::INFINITY)
        });
        Ok(Self { whole, parts: parts.collect() })
    }
}

/// Change of a pixel's depth by a function.
#[derive(Clone)]
struct Change {
    frame: usize,
    covariates: Vec<f64>,
    /// Change in the unit of the function.
    value: f64,
    /// Standard deviations that 1 of it is worth.
    sigmas: f64,
    /// The noise, in standard deviations.
    noise: f64,
}

/// A covariate of a pixel of a fit, or what grows with it.
fn value(covariate: &str, pixel: &PixelError, [fx, fy, cx, cy, _]: [f64; 5]) -> f64 {
    let [u, v] = pixel.context.pixel;
    match covariate {
        "x" => u,
        "y" => v,
        "r" => ((u - cx) / fx).hypot((v - cy) / fy),
        "z" => pixel.board_depth_mm,
        "incidence" => -pixel.cos_incidence,
        "amplitude" => pixel.context.amplitude,
        "timestamp_s" => pixel.context.time_s,
        _ => pixel.context.temperature_c,
    }
}

/// The changes without their weighted means in groups of equally many pixels by one of the covariates.
fn without_function_of(covariate: usize, pixels: &[Change]) -> Vec<Change> {
    let mut order: Vec<usize> = (0..pixels.len()).collect();
    order.sort_by(|a, b| pixels[*a].covariates[covariate].total_cmp(&pixels[*b].covariates[covariate]));
    let mut left = pixels.to_vec();
    for group in order.chunks(pixels.len().div_ceil(STEPS).max(1)) {
        let weight = |i: &usize| pixels[*i].sigmas.powi(2);
        let total: f64 = group.iter().map(weight).sum();
        let mean = group.iter().map(|i| weight(i) * pixels[*i].value).sum::<f64>() / total;
        group.iter().for_each(|i| left[*i].value -= mean);
    }
    left
}

/// The size that a capture can just show over that of these changes.
fn detectable_share(pixels: &[Change]) -> Result<f64, Failure> {
    let mut seen = 0.0;
    let mut scores: BTreeMap<usize, f64> = BTreeMap::new();
    for pixel in pixels {
        let change = pixel.sigmas * pixel.value;
        seen += change * change;
        *scores.entry(pixel.frame).or_default() += change * pixel.noise;
    }
    if seen < LEAST_SEEN {
        return Err("camera and poses take up the function".into());
    }
    let variance: f64 = scores.values().map(|score| score * score).sum();
    let thresholds = Thresholds::default();
    let level = thresholds.level / catalogue().len() as f64;
    Ok((noncentrality(RANK, level, thresholds.power) * variance).sqrt() / seen)
}

type Shape = Box<dyn Fn(f64) -> f64 + Send + Sync>;

/// A function on −1 … 1 that is not in the library of the search: bumps, sigmoids, roots, triangles, saturation, waves with a
/// phase.
fn shape(rng: &mut ChaCha8Rng) -> (Shape, String) {
    let middle = rng.random_range(-0.5..0.5);
    let width = rng.random_range(0.15..0.5);
    match rng.random_range(0..6) {
        0 => (Box::new(move |t| (-((t - middle) / width).powi(2)).exp()), format!("bump {middle:.2} {width:.2}")),
        1 => (Box::new(move |t| ((t - middle) / width).tanh()), format!("sigmoid {middle:.2} {width:.2}")),
        2 => (Box::new(|t| (t + 1.0_f64).max(0.0).powf(1.5)), "power 1.5".to_owned()),
        3 => (Box::new(move |t| (t - middle).abs()), format!("triangle {middle:.2}")),
        4 => (Box::new(|t| (t + 1.0) / (t + 1.5)), "saturation".to_owned()),
        _ => {
            let (cycles, phase) = (rng.random_range(1.0..5.0), rng.random_range(0.0..TAU));
            (Box::new(move |t| (0.5 * TAU * cycles * t + phase).sin()), format!("wave {cycles:.2} {phase:.2}"))
        }
    }
}

/// A covariate of an observation over its usual range, mapped to −1 … 1.
fn scaled(covariate: &str, o: &Observation) -> f64 {
    let [x, y] = o.ray;
    let (value, low, high) = match covariate {
        "x" => (x, -0.5, 0.5),
        "y" => (y, -0.4, 0.4),
        "r" => (x.hypot(y), 0.0, 0.55),
        "z" => (o.depth_mm, 400.0, 1300.0),
        "incidence" => (1.0 / o.cosine - 1.0, 0.0, 0.6),
        "amplitude" => (o.amplitude.max(0.02).ln(), 0.05_f64.ln(), 0.9_f64.ln()),
        "timestamp_s" => (o.time_s, 0.0, 180.0),
        _ => (o.temperature_c, 26.0, 36.0),
    };
    (2.0 * (value - low) / (high - low) - 1.0).clamp(-1.3, 1.3)
}

/// A function of one covariate, or the product of functions of two, in a random place and form, with its covariates and in words.
/// `size_mm` is its root mean square over the usual ranges.
pub(super) fn random_function(rng: &mut ChaCha8Rng, size_mm: f64) -> (GivenEffect, Vec<&'static str>, String) {
    let first = COVARIATES[rng.random_range(0..COVARIATES.len())];
    let second = COVARIATES[rng.random_range(0..COVARIATES.len())];
    let covariates =
        if rng.random_bool(0.5) || family(first) == family(second) { vec![first] } else { vec![first, second] };
    let shapes: Vec<(Shape, String)> = covariates.iter().map(|_| shape(rng)).collect();
    let words: Vec<String> = covariates.iter().zip(&shapes).map(|(c, (_, words))| format!("{c}: {words}")).collect();
    let place = Place::ALL[rng.random_range(0..2)];
    let form = Form::ALL[rng.random_range(0..3)];
    let arguments = covariates.clone();
    let function =
        move |o: &Observation| -> f64 { arguments.iter().zip(&shapes).map(|(c, (f, _))| f(scaled(c, o))).product() };
    // Scaled to its size over the usual ranges, without its mean, which D takes up in part.
    let mut samples = Vec::new();
    for _ in 0..4000 {
        let depth_mm = rng.random_range(400.0..1300.0);
        let o = Observation {
            pixel: [0.0; 2],
            ray: [rng.random_range(-0.5..0.5), rng.random_range(-0.4..0.4)],
            depth_mm,
            cosine: rng.random_range(0.65..1.0),
            amplitude: rng.random_range(0.05..0.9),
            time_s: rng.random_range(0.0..180.0),
            temperature_c: rng.random_range(26.0..36.0),
        };
        samples.push(function(&o));
    }
    let mean = samples.iter().sum::<f64>() / samples.len() as f64;
    let rms = (samples.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / samples.len() as f64).sqrt();
    // Equal millimetres at a metre in all forms.
    let scale = size_mm / rms
        * match form {
            Form::Depth => 1.0,
            Form::Factor => 1e-3,
            Form::InverseDepth => -1e-6,
        };
    let function = Arc::new(move |o: &Observation| scale * function(o));
    let words = format!("{size_mm:.2} mm of {}", words.join(" times "));
    (GivenEffect { name: "random".to_owned(), place, form, function }, covariates, words)
}
