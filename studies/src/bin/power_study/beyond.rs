//! Effects that the catalogue does not have: invented ones, and its own taken out of it.

use depthcal::calibration::diagnose::{CameraDiagnoseOptions, FREE_MAP, diagnose_camera};
use depthcal::io::Verdict;
use depthcal::model::Register;
use depthcal_simulate::{Effect, catalogue, uncatalogued};
use rayon::prelude::*;

use super::single::detectable_size;
use super::{Failure, Study, depth_rms_mm, median, names, percent, simulation};

/// One run: names, verdict, held-out depth error before and after, mm.
type Run = (Vec<String>, Verdict, [f64; 2]);

fn header() {
    println!("| effect | unexplained | no name | verdict right | held-out depth rms before, mm | after, mm |");
    println!("|---|---|---|---|---|---|");
}

fn row(name: &str, runs: &[Run]) {
    let unexplained = runs.iter().filter(|r| r.1 == Verdict::Unexplained).count();
    let is_nameless = |r: &&Run| r.0.iter().all(|n| n == FREE_MAP);
    let nameless = runs.iter().filter(is_nameless).count();
    let right = runs.iter().filter(is_nameless).filter(|r| r.1 == Verdict::Unexplained).count();
    let n = runs.len();
    println!(
        "| {name} | {} | {} | {} | {:.2} | {:.2} |",
        percent(unexplained, n),
        percent(nameless, n),
        percent(right, n),
        median(runs.iter().map(|r| r.2[0]).collect()),
        median(runs.iter().map(|r| r.2[1]).collect()),
    );
}

impl Study {
    /// Effects that no catalogue describes.
    pub fn beyond(&self) {
        header();
        for info in uncatalogued().iter().filter(|e| self.wants(e.name)) {
            self.outside(info.name, &CameraDiagnoseOptions::default(), |_| Ok(Effect::with_default_size(info.name)?));
        }
    }

    /// Effects of the catalogue, taken out of it, at four times the size that it would have shown.
    pub fn absent(&self) {
        header();
        for info in catalogue().iter().filter(|e| self.wants(e.name)) {
            let mut options = CameraDiagnoseOptions::default();
            options.calibrate.register = Register::builtin().without(info.name);
            self.outside(info.name, &options, |seed| {
                Ok(Effect::new(info.name, 4.0 * detectable_size(info.name, seed)?)?)
            });
        }
    }

    fn outside(
        &self,
        name: &str,
        options: &CameraDiagnoseOptions,
        effect: impl Fn(u64) -> Result<Effect, Failure> + Sync,
    ) {
        let runs: Vec<Run> = self
            .numbers()
            .into_par_iter()
            .filter_map(|seed| {
                let run = || -> Result<Run, Failure> {
                    let d = diagnose_camera(&self.capture(&simulation(&[effect(seed)?], seed)?)?, None, options)?;
                    let errors = [depth_rms_mm(&d.before), depth_rms_mm(&d.after)];
                    let told: Vec<String> =
                        d.rounds.iter().map(|r| format!("{:?}: {:?}", r.decision, r.outcome)).collect();
                    eprintln!("{name} {seed}: {:?} {:?} {errors:.3?} {}", d.verdict, names(&d), told.join(" / "));
                    Ok((names(&d), d.verdict, errors))
                };
                run().inspect_err(|e| eprintln!("{name} seed {seed}: {e}")).ok()
            })
            .collect();
        row(name, &runs);
    }
}
