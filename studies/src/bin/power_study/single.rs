//! One undeclared effect: is it named, how large is it said to be, and what does the correction leave?

use depthcal::calibration::calibrate::{CameraOptions, calibrate_camera};
use depthcal::calibration::diagnose::examination::scores;
use depthcal::calibration::diagnose::{CameraDiagnoseOptions, Thresholds};
use depthcal::calibration::judge::cross_validation::{cross_validate_camera, errors};
use depthcal::calibration::judge::parts::Parts;
use depthcal::calibration::simulated;
use depthcal::io::Verdict;
use depthcal::model::{Of, On, PieceSpec, Placement};
use depthcal_simulate::{Effect, EffectTruth, Form, Place, PointOptions, Simulation, Truth, catalogue};
use depthcal_statistics::noncentrality;
use rayon::prelude::*;

use super::size::{Recovery, recovery};
use super::{Failure, Study, depth_rms_mm, median, names, percent, simulation};

/// The size of an effect that a capture of this seed shows in 80 % of cases, in the simulator's unit: where the
/// noncentrality of its score test, with the constants that it really has, is that of the power asked for.
pub fn detectable_size(name: &str, seed: u64) -> Result<f64, Failure> {
    detectable(name, None, seed)
}

/// As [`detectable_size`], of an effect in a place and a form.
pub fn detectable(name: &str, place: Option<(Place, Form)>, seed: u64) -> Result<f64, Failure> {
    let mut size = Effect::with_default_size(name)?.size;
    // Planes of whole frames would take up part of the effect.
    let options = CameraOptions { frame_planes: false, ..CameraOptions::default() };
    let thresholds = Thresholds::default();
    let level = thresholds.level / catalogue().len() as f64;
    let (mut lambda, mut rank) = (1.0, 1);
    for _ in 0..6 {
        let effect = Effect { place, ..Effect::new(name, size)? };
        let simulation = simulation(&[effect], seed)?;
        let observed = simulation.observe_points(&PointOptions::default())?;
        let truth = observed.truth.effects.first().ok_or("no effect")?;
        let spec = declared(truth, last_s(&observed.truth), 1.0).placed(placement(truth));
        let fit = calibrate_camera(&simulated::capture(&observed), &options)?;
        let score = scores(&fit, &options.register, &[spec])?.remove(0);
        lambda = (score.statistic - score.rank as f64).max(1.0);
        rank = score.rank;
        if (200.0..800.0).contains(&lambda) {
            break;
        }
        size *= (400.0 / lambda).sqrt().clamp(0.1, 10.0);
    }
    Ok(size * (noncentrality(rank, level, thresholds.power) / lambda).sqrt())
}

/// Place and form of an effect, as the model has them.
pub fn placement(truth: &EffectTruth) -> Placement {
    truth.place.map_or_else(Placement::default, |(place, form)| {
        let state = if place == Place::True { Of::True } else { Of::Measured };
        let on = match form {
            Form::Depth => On::Depth,
            Form::Factor => On::Factor,
            Form::InverseDepth => On::InverseDepth,
        };
        Placement { of: state, on: Some(on) }
    })
}

/// Time of the last frame, s.
pub fn last_s(truth: &Truth) -> f64 {
    truth.frames.iter().map(|f| f.conditions.time_s).fold(0.0, f64::max)
}

/// Result of the diagnosis of one capture.
struct Run {
    names: Vec<String>,
    verdict: Verdict,
    indistinguishable: bool,
    /// Held-out depth rms before, after, and of the fit that was told the effect, mm.
    errors: [f64; 3],
    recovery: Option<Recovery>,
}

/// How the effect is declared by one who knows it, with the constants that are not fitted. Amplitudes of a capture are
/// `full_scale` times the simulator's.
pub fn declared(truth: &EffectTruth, last_s: f64, full_scale: f64) -> PieceSpec {
    let value = |key: &str| truth.parameters.get(key).copied().unwrap_or(f64::NAN);
    match truth.name.as_str() {
        "cyclic_depth" => PieceSpec::new("cyclic_depth").with("period_mm", value("period_mm")),
        "disparity_ripple" => PieceSpec::new("disparity_ripple").with("period_per_mm", value("period_per_mm")),
        "temporal_drift" => {
            PieceSpec::new("temporal_drift").with("tau_s", value("time_constant_share_of_session") * last_s)
        }
        "reflectivity_bias" => {
            PieceSpec::new("reflectivity_bias").with("reference", value("reference_amplitude") * full_scale)
        }
        name => PieceSpec::new(name),
    }
}

impl Study {
    fn run(&self, simulation: &Simulation, name: &str) -> Result<Run, Failure> {
        let diagnosis = self.diagnose(simulation)?;
        let all = simulation.truth()?;
        let truth = all.effects.iter().find(|e| e.name == name).ok_or("no such effect")?;
        let full_scale = if self.images { 255.0 } else { 1.0 };
        let effects = vec![declared(truth, last_s(&all), full_scale)];
        let told = CameraOptions { effects, ..CameraOptions::default() };
        let folds = CameraDiagnoseOptions::default().folds;
        let with_effect = calibrate_camera(&diagnosis.last.capture.detected(), &told)?;
        let oracle = cross_validate_camera(&with_effect, folds, Parts::Interleaved, &told)?;
        let recovery = if diagnosis.last.camera.block(name).is_some() {
            recovery(simulation, &diagnosis.last, truth, full_scale)?
        } else {
            None
        };
        let first = diagnosis.steps.first();
        Ok(Run {
            indistinguishable: first
                .is_some_and(|s| s.effects[0] != name && s.indistinguishable.iter().any(|i| i == name)),
            names: names(&diagnosis),
            verdict: diagnosis.verdict,
            errors: [
                depth_rms_mm(&diagnosis.before),
                depth_rms_mm(&diagnosis.after),
                errors(&oracle).depth_rms_mm.unwrap_or(f64::NAN),
            ],
            recovery,
        })
    }

    /// Every effect of the catalogue at multiples of its detectable size.
    pub fn single(&self) {
        println!(
            "| effect | size / detectable | size | named first | or said to be indistinguishable | a false name | \
             unexplained | said size / true | within 10 % | rms of its deviation | held-out after / oracle | within 10 % |"
        );
        println!("|---|---|---|---|---|---|---|---|---|---|---|---|");
        for info in catalogue().iter().filter(|e| self.wants(e.name)) {
            let sizes: Vec<(u64, f64)> = self
                .numbers()
                .into_par_iter()
                .filter_map(|seed| {
                    let size =
                        detectable_size(info.name, seed).inspect_err(|e| eprintln!("{} seed {seed}: {e}", info.name));
                    Some((seed, size.ok()?))
                })
                .collect();
            for factor in &self.factors {
                let runs: Vec<(f64, Run)> = sizes
                    .par_iter()
                    .filter_map(|&(seed, detectable)| {
                        let run = || -> Result<_, Failure> {
                            let size = factor * detectable;
                            let run = self.run(&simulation(&[Effect::new(info.name, size)?], seed)?, info.name)?;
                            eprintln!(
                                "{} ×{factor} {seed}: {size:.3} {} {:?} {:?} {:.3?} {:.3?}",
                                info.name, info.unit, run.verdict, run.names, run.errors, run.recovery
                            );
                            Ok((size, run))
                        };
                        run().inspect_err(|e| eprintln!("{} seed {seed}: {e}", info.name)).ok()
                    })
                    .collect();
                row(info.name, info.unit, *factor, &runs);
            }
        }
    }
}

fn row(name: &str, unit: &str, factor: f64, runs: &[(f64, Run)]) {
    let n = runs.len();
    let count = |is: &dyn Fn(&Run) -> bool| percent(runs.iter().filter(|(_, r)| is(r)).count(), n);
    let first = |r: &Run| r.names.first().is_some_and(|f| f == name);
    let recoveries = || runs.iter().filter_map(|(_, r)| r.recovery);
    let sized: Vec<f64> = recoveries().map(|r| r.ratio).collect();
    let near = sized.iter().filter(|r| (*r - 1.0).abs() <= 0.1).count();
    println!(
        "| {name} | {factor} | {:.2} {unit} | {} | {} | {} | {} | {:.2} | {} | {:.0} % | {:.3} | {} |",
        median(runs.iter().map(|(size, _)| *size).collect()),
        count(&first),
        count(&|r| first(r) || r.indistinguishable),
        count(&|r| r.names.iter().any(|f| f != name)),
        count(&|r| r.verdict == Verdict::Unexplained),
        median(sized.clone()),
        percent(near, sized.len()),
        100.0 * median(recoveries().map(|r| r.deviation).collect()),
        median(runs.iter().map(|(_, r)| r.errors[1] / r.errors[2]).collect()),
        count(&|r| r.errors[1] <= 1.1 * r.errors[2]),
    );
}
