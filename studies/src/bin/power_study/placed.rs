//! A depth effect of the catalogue in a place and a form drawn at random: is it named, and are place and form right?

use depthcal::calibration::calibrate::{CameraOptions, calibrate_camera};
use depthcal::calibration::diagnose::CameraDiagnoseOptions;
use depthcal::calibration::judge::cross_validation::{cross_validate_camera, errors};
use depthcal::calibration::judge::parts::Parts;
use depthcal_simulate::{Effect, Form, Place, catalogue};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::single::{declared, detectable, last_s, placement};
use super::{Failure, Study, depth_rms_mm, median, names, percent, simulation};

/// Result of the diagnosis of one capture.
struct Run {
    name: &'static str,
    names: Vec<String>,
    /// Effects that the captures cannot tell from those that are named.
    rivals: Vec<String>,
    /// Whether place and form are right, and whether they are right or listed as not told apart.
    place: bool,
    listed: bool,
    /// Held-out depth rms before, after, and of the fit that was told effect, place and form, mm.
    errors: [f64; 3],
}

impl Run {
    fn is_named(&self) -> bool {
        self.names.iter().any(|n| n == self.name)
    }

    fn is_rival(&self) -> bool {
        self.rivals.iter().any(|n| n == self.name)
    }
}

impl Study {
    /// One capture per seed and effect; rows by effect.
    pub fn placed(&self) {
        println!(
            "| effect | captures | named | named or listed as not told apart | place and form right | right or listed | a false name, \
             the true one not listed | held-out after / oracle | within 10 % |"
        );
        println!("|---|---|---|---|---|---|---|---|---|");
        let mut all = Vec::new();
        let effects = (0..).zip(catalogue().iter().filter(|e| e.hook == "depth"));
        for (number, info) in effects.filter(|(_, e)| self.wants(e.name)) {
            let runs: Vec<Run> = self
                .numbers()
                .into_par_iter()
                .filter_map(|seed| {
                    self.placed_run(info.name, number, seed)
                        .inspect_err(|e| eprintln!("{} {seed}: {e}", info.name))
                        .ok()
                })
                .collect();
            row(info.name, &runs);
            all.extend(runs);
        }
        row("all", &all);
    }

    fn placed_run(&self, name: &'static str, number: u64, seed: u64) -> Result<Run, Failure> {
        let mut rng = ChaCha8Rng::seed_from_u64(1000 * number + seed);
        let place = Place::ALL[rng.random_range(0..Place::ALL.len())];
        let form = Form::ALL[rng.random_range(0..Form::ALL.len())];
        let factor = self.factors.last().copied().unwrap_or(4.0);
        let size = factor * detectable(name, Some((place, form)), seed)?;
        let effect = Effect::new(name, size)?.placed(place, form)?;
        let simulation = simulation(&[effect], seed)?;
        let d = self.diagnose(&simulation)?;
        let truth = simulation.truth()?;
        let spec = declared(&truth.effects[0], last_s(&truth), if self.images { 255.0 } else { 1.0 });
        let expected = placement(&truth.effects[0]);
        let told = CameraOptions { effects: vec![spec.placed(expected)], ..CameraOptions::default() };
        let with_effect = calibrate_camera(&d.last.capture.detected(), &told)?;
        let oracle =
            cross_validate_camera(&with_effect, CameraDiagnoseOptions::default().folds, Parts::Interleaved, &told)?;
        let step = d.steps.iter().find(|s| s.effects[0] == name);
        let is_expected = |p: &depthcal::io::DiagnosisPlace| p.of == expected.of && Some(p.on) == expected.on;
        let place_is_right = step.and_then(|s| s.place).is_some_and(|p| is_expected(&p));
        let is_listed = step.is_some_and(|s| s.places_not_told_apart.iter().any(is_expected));
        let run = Run {
            name,
            names: names(&d),
            rivals: d.steps.iter().flat_map(|s| s.indistinguishable.clone()).collect(),
            place: place_is_right,
            listed: place_is_right || is_listed,
            errors: [depth_rms_mm(&d.before), depth_rms_mm(&d.after), errors(&oracle).depth_rms_mm.unwrap_or(f64::NAN)],
        };
        eprintln!(
            "{name}={:.4}{expected} {seed}: {:?} {:?} or {:?} place {} listed {} {:.3?} {:?}",
            size,
            d.verdict,
            d.steps.iter().map(|s| s.spec.to_string()).collect::<Vec<_>>(),
            run.rivals,
            run.place,
            run.listed,
            run.errors,
            d.possible
                .iter()
                .map(|p| format!(
                    "{} {:.1} ({:.1} to {:.1}) %",
                    p.spec, p.gain_percent.value, p.gain_percent.low, p.gain_percent.high
                ))
                .collect::<Vec<_>>()
        );
        Ok(run)
    }
}

fn row(name: &str, runs: &[Run]) {
    let n = runs.len();
    let count = |is: &dyn Fn(&Run) -> bool| percent(runs.iter().filter(|r| is(r)).count(), n);
    println!(
        "| {name} | {n} | {} | {} | {} | {} | {} | {:.3} | {} |",
        count(&|r| r.is_named()),
        count(&|r| r.is_named() || r.is_rival()),
        count(&|r| r.place),
        count(&|r| r.listed || (!r.is_named() && r.is_rival())),
        count(&|r| r.names.iter().filter(|n| *n != r.name).count() > usize::from(!r.is_named() && r.is_rival())),
        median(runs.iter().map(|r| r.errors[1] / r.errors[2]).collect()),
        count(&|r| r.errors[1] <= 1.1 * r.errors[2]),
    );
}
