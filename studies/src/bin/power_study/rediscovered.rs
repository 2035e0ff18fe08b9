//! Effects of the catalogue that are taken out of it, one after the other: what a diagnosis makes of them.

use std::collections::BTreeSet;

use depthcal::Register;
use depthcal::calibration::calibrate::{CameraOptions, calibrate_camera};
use depthcal::calibration::diagnose::{CameraDiagnoseOptions, CameraDiagnosis, FREE_MAP, diagnose_camera};
use depthcal::calibration::judge::camera::evaluate_camera;
use depthcal::calibration::judge::cross_validation::{cross_validate_camera, errors};
use depthcal::calibration::judge::parts::Parts;
use depthcal::io::Verdict;
use depthcal_simulate::{Effect, Pose, Simulation};
use rayon::prelude::*;

use super::formulas::family;
use super::single::{declared, detectable, last_s};
use super::{Failure, Study, depth_rms_mm, median, names, percent, simulation};

/// An effect of the catalogue.
struct Known {
    name: &'static str,
    covariates: &'static [&'static str],
    /// A part of the text of formulas of the same form; `None` where no formula of the search has the form.
    form: Option<&'static str>,
}

/// Effects that act on depth; those of light of whole frames are left out.
const CATALOGUE: [Known; 10] = [
    Known { name: "cyclic_depth", covariates: &["z"], form: Some("sin(2 π z/period)") },
    Known { name: "disparity_ripple", covariates: &["z"], form: Some("sin(2 π ρ/period)") },
    Known { name: "quadratic_depth", covariates: &["z"], form: Some("z²") },
    Known { name: "reflectivity_bias", covariates: &["amplitude"], form: Some("ln(A/") },
    Known { name: "incidence_bias", covariates: &["incidence"], form: Some("a κ") },
    Known { name: "radial_range", covariates: &["r"], form: Some("r²") },
    Known { name: "range_offset", covariates: &["r"], form: None },
    Known { name: "temperature_drift", covariates: &["temperature_c"], form: Some("(T − t₀)") },
    Known { name: "temporal_drift", covariates: &["timestamp_s"], form: Some("exp(−t/τ)") },
    Known { name: "projector_distortion", covariates: &["x", "y"], form: None },
];

/// Covariates of an effect of the catalogue; those of the image and of the board have places of their own.
pub(super) fn covariates_of(name: &str) -> &'static [&'static str] {
    CATALOGUE.iter().find(|known| known.name == name).map_or(&["none"], |known| known.covariates)
}

/// The effects of the catalogue that a diagnosis names.
pub fn names_of_catalogue(d: &CameraDiagnosis) -> Vec<String> {
    let is_formula = |name: &String| d.formulas.iter().any(|f| f.effect.name() == name);
    names(d).into_iter().filter(|name| name != FREE_MAP && !is_formula(name)).collect()
}

/// The families of the covariates of a diagnosis' formulas and of these names.
pub fn covariates_found(d: &CameraDiagnosis, named: &[String]) -> BTreeSet<&'static str> {
    let of_formulas = d.formulas.iter().flat_map(|f| f.covariates.iter().map(|c| family(c)));
    let of_names = named.iter().flat_map(|name| covariates_of(name)).map(|c| family(c));
    of_formulas.chain(of_names).collect()
}

/// Error over that of a fit that was told the effect up to which a model is equivalent to it.
const EQUIVALENT: f64 = 1.05;
/// Distances of the captures to which models are extrapolated, over those that they were fitted to.
const BEYOND: f64 = 1.3;

/// Result of the diagnosis of one capture.
struct Run {
    /// Whether the covariates of formulas and names are the effect's; whether one has no part in it.
    right: bool,
    wrong: bool,
    /// Whether there is anything but a free map.
    described: bool,
    exact: bool,
    formula: bool,
    verdict: Verdict,
    map: bool,
    /// Error over that of the fit that was told the effect: on left-out frames, and on farther ones.
    ratios: [f64; 2],
}

impl Run {
    fn is_equivalent(&self) -> bool {
        self.described && self.ratios.iter().all(|ratio| *ratio <= EQUIVALENT)
    }
}

impl Study {
    /// Every effect of the catalogue that acts on depth, taken out of it.
    pub fn rediscovered(&self) {
        println!(
            "| effect | captures | exact form | an equivalent one | right covariates only | a part of them | free map only | a wrong covariate | \
             nothing, `adequate` | a formula | left-out error over that with the effect | the same, at {BEYOND} times the distances |"
        );
        println!("|---|---|---|---|---|---|---|---|---|---|---|---|");
        let mut all = Vec::new();
        for factor in &self.factors {
            let mut of_factor = Vec::new();
            for known in CATALOGUE.iter().filter(|known| self.wants(known.name)) {
                let run = |seed| {
                    let run = self.rediscover(known, *factor, seed);
                    run.inspect_err(|e| eprintln!("{} {seed}: {e}", known.name)).ok()
                };
                let runs: Vec<Run> = self.numbers().into_par_iter().filter_map(run).collect();
                row(&format!("`{}` {factor} ×", known.name), &runs);
                of_factor.extend(runs);
            }
            row(&format!("all {factor} ×"), &of_factor);
            all.extend(of_factor);
        }
    }

    fn rediscover(&self, known: &Known, factor: f64, seed: u64) -> Result<Run, Failure> {
        let name = known.name;
        let size = factor * detectable(name, None, seed)?;
        let effect = || Effect::new(name, size);
        let near = simulation(&[effect()?], seed)?;
        let truth = near.truth()?;
        let d = {
            let register = Register::builtin().without(name);
            let calibrate = CameraOptions { register, ..CameraOptions::default() };
            diagnose_camera(
                &self.capture(&near)?,
                None,
                &CameraDiagnoseOptions { calibrate, ..CameraDiagnoseOptions::default() },
            )?
        };
        let of_effect = truth.effects.iter().find(|e| e.name == name).ok_or("no such effect")?;
        let effects = vec![declared(of_effect, last_s(&truth), if self.images { 255.0 } else { 1.0 })];
        let told = CameraOptions { effects, ..CameraOptions::default() };
        let oracle = calibrate_camera(&d.last.capture.detected(), &told)?;
        let folds = CameraDiagnoseOptions::default().folds;
        let held_out = errors(&cross_validate_camera(&oracle, folds, Parts::Interleaved, &told)?);
        let far = self.capture(&beyond(near, &truth.frames.iter().map(|f| f.pose).collect::<Vec<_>>()))?;
        let rms_far = |camera| errors(&evaluate_camera(camera, &far)).depth_rms_mm.unwrap_or(f64::NAN);
        let ratios = [
            depth_rms_mm(&d.after) / held_out.depth_rms_mm.unwrap_or(f64::NAN),
            rms_far(&d.last.camera) / rms_far(&oracle.camera),
        ];
        let run = Run::new(known, &d, ratios);
        let texts: Vec<String> = d.formulas.iter().map(|f| f.effect.text()).collect();
        eprintln!(
            "{name} {factor} × {seed}: {:?} {:?} {texts:?} right {} exact {} {ratios:.3?} refused {:?}",
            d.verdict,
            names(&d),
            run.right,
            run.exact,
            d.formula_refused
        );
        Ok(run)
    }
}

/// A capture with the board at [`BEYOND`] times the distance.
fn beyond(near: Simulation, poses: &[Pose]) -> Simulation {
    let far = poses.iter().map(|pose| Pose { translation: pose.translation.map(|t| BEYOND * t), ..*pose });
    near.poses(far.collect())
}

impl Run {
    fn new(known: &Known, d: &CameraDiagnosis, ratios: [f64; 2]) -> Self {
        let formulas = &d.formulas;
        let named = names_of_catalogue(d);
        let covariates = covariates_found(d, &named);
        let truth: BTreeSet<&str> = known.covariates.iter().map(|c| family(c)).collect();
        Self {
            right: covariates == truth,
            wrong: !covariates.is_subset(&truth),
            described: !covariates.is_empty(),
            exact: known.form.is_some_and(|form| formulas.iter().any(|f| f.effect.text().contains(form))),
            formula: !formulas.is_empty(),
            verdict: d.verdict,
            map: d.steps.iter().any(|s| s.effects[0] == FREE_MAP),
            ratios,
        }
    }
}

fn row(title: &str, runs: &[Run]) {
    let n = runs.len();
    if n == 0 {
        return;
    }
    let count = |is: &dyn Fn(&Run) -> bool| percent(runs.iter().filter(|r| is(r)).count(), n);
    println!(
        "| {title} | {n} | {} | {} | {} | {} | {} | {} | {} | {} | {:.3} | {:.3} |",
        count(&|r| r.exact && r.right),
        count(&|r| !(r.exact && r.right) && r.is_equivalent()),
        count(&|r| r.right && !r.exact && !r.is_equivalent()),
        count(&|r| r.described && !r.right && !r.wrong),
        count(&|r| !r.described && r.map),
        count(&|r| r.wrong && !r.is_equivalent()),
        count(&|r| r.verdict == Verdict::Adequate),
        count(&|r| r.formula),
        median(runs.iter().map(|r| r.ratios[0]).collect()),
        median(runs.iter().map(|r| r.ratios[1]).collect()),
    );
}
