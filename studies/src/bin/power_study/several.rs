//! One to three effects at once, of shapes that neither the catalogue nor the library of formulas has, on boards of which half
//! are bent and stretched.

use std::collections::BTreeSet;

use depthcal::calibration::diagnose::CameraDiagnosis;
use depthcal::io::Verdict;
use depthcal_simulate::{Effect, GivenEffect, Simulation};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::drawn::drawn_of;
use super::formulas::{family, random_function};
use super::rediscovered::{covariates_of, names_of_catalogue};
use super::{Failure, Study, depth_rms_mm, median, names, percent};

/// Smallest and largest function, mm root mean square over the usual ranges; between them evenly in the logarithm.
const SIZES_MM: [f64; 2] = [1.0, 6.0];
/// Smallest and largest bend, and stretch, of the board, mm.
const BENDS_MM: [f64; 2] = [0.7, 3.0];
const STRETCHES_MM: [f64; 2] = [0.2, 1.0];
/// Rise of the held-out error by an effect alone from which it has to be seen.
const MATTERS: f64 = 1.05;
/// Held-out error over that of the same capture without effects up to which the loop has reached it.
const REACHED: f64 = 1.1;
/// Names of effects of the board, which stand for each other.
const OF_BOARD: [&str; 3] = ["board_bow", "board_warp", "print_scale"];

/// An effect of a capture, and what a diagnosis may call it.
struct Cause {
    words: String,
    covariates: BTreeSet<&'static str>,
    of_board: bool,
}

/// The effects of a capture; every call draws the same ones.
struct Causes {
    named: Vec<Effect>,
    given: Vec<GivenEffect>,
    causes: Vec<Cause>,
}

fn log_uniform(rng: &mut ChaCha8Rng, [low, high]: [f64; 2]) -> f64 {
    low * (high / low).powf(rng.random())
}

impl Causes {
    fn draw(seed: u64) -> Result<Self, Failure> {
        let mut rng = ChaCha8Rng::seed_from_u64(52_000 + seed);
        let mut drawn = Self { named: Vec::new(), given: Vec::new(), causes: Vec::new() };
        if rng.random_bool(0.5) {
            for (name, sizes) in [("board_bow", BENDS_MM), ("print_scale", STRETCHES_MM)] {
                let size = log_uniform(&mut rng, sizes);
                drawn.named.push(Effect::new(name, size)?);
                let words = format!("{name} {size:.2}");
                drawn.causes.push(Cause { words, covariates: BTreeSet::new(), of_board: true });
            }
        }
        for number in 0..rng.random_range(1..=3) {
            let size = log_uniform(&mut rng, SIZES_MM);
            let (mut effect, covariates, words) = random_function(&mut rng, size);
            let words = format!("{words} of {:?} as {:?}", effect.place, effect.form);
            effect.name = format!("function {number}");
            drawn.given.push(effect);
            let covariates = covariates.into_iter().map(family).collect();
            drawn.causes.push(Cause { words, covariates, of_board: false });
        }
        Ok(drawn)
    }

    /// The capture with these of its effects.
    fn simulation(self, seed: u64, has: impl Fn(usize) -> bool) -> Result<Simulation, Failure> {
        let frames = 12 + (seed as usize * 7) % 19;
        let boards = self.named.len();
        let named: Vec<Effect> = self.named.into_iter().enumerate().filter(|(i, _)| has(*i)).map(|(_, e)| e).collect();
        let given = self.given.into_iter().enumerate().filter(|(i, _)| has(boards + i)).map(|(_, e)| e);
        Ok(drawn_of(&named, seed, Some(frames))?.simulation.given(given))
    }
}

/// Result of the diagnosis of one capture.
struct Run {
    /// Whether each effect that matters is seen.
    seen: Vec<bool>,
    /// Names of the catalogue that no effect of the capture is.
    wrong: Vec<String>,
    /// Held-out error over that of the same capture without effects.
    ratio: f64,
    verdict: Verdict,
}

/// Whether the diagnosis has the effect by a name or by its covariates.
fn is_seen(cause: &Cause, d: &CameraDiagnosis, named: &[String]) -> bool {
    if cause.of_board {
        return named.iter().any(|name| OF_BOARD.contains(&name.as_str()));
    }
    let of_formulas = d.formulas.iter().map(|f| f.covariates.iter().map(|c| family(c)).collect::<BTreeSet<_>>());
    let of_names = named.iter().map(|name| covariates_of(name).iter().map(|c| family(c)).collect());
    of_formulas.chain(of_names).any(|covariates| covariates == cause.covariates)
}

impl Study {
    /// One capture per seed, and as many of them without effects.
    pub fn several(&self) {
        let run = |seed| self.one_to_three(seed).inspect_err(|e| eprintln!("several {seed}: {e}")).ok();
        let runs: Vec<Run> = self.numbers().into_par_iter().filter_map(run).collect();
        let seen: Vec<bool> = runs.iter().flat_map(|run| run.seen.iter().copied()).collect();
        let n = runs.len();
        println!(
            "one to three effects, {n} captures: seen {} of {} that matter; a false name in {}; error within {:.0} % of that \
             without effects in {}, median {:.3}; adequate {}",
            percent(seen.iter().filter(|seen| **seen).count(), seen.len()),
            seen.len(),
            percent(runs.iter().filter(|run| !run.wrong.is_empty()).count(), n),
            100.0 * (REACHED - 1.0),
            percent(runs.iter().filter(|run| run.ratio <= REACHED).count(), n),
            median(runs.iter().map(|run| run.ratio).collect()),
            percent(runs.iter().filter(|run| run.verdict == Verdict::Adequate).count(), n),
        );
    }

    fn one_to_three(&self, seed: u64) -> Result<Run, Failure> {
        let with = |has: &dyn Fn(usize) -> bool| Causes::draw(seed)?.simulation(seed, has);
        let causes = Causes::draw(seed)?.causes;
        let floor = self.error_without(&with(&|_| false)?)?;
        let mut costs = Vec::new();
        for number in 0..causes.len() {
            costs.push(self.error_without(&with(&|i| i == number)?)? / floor);
        }
        let d = self.diagnose(&with(&|_| true)?)?;
        let named = names_of_catalogue(&d);
        let mattering = causes.iter().zip(&costs).filter(|(_, cost)| **cost > MATTERS);
        let seen = mattering.map(|(cause, _)| is_seen(cause, &d, &named)).collect();
        let true_covariates: BTreeSet<&str> = causes.iter().flat_map(|c| c.covariates.iter().copied()).collect();
        let is_wrong = |name: &String| match OF_BOARD.contains(&name.as_str()) {
            true => !causes.iter().any(|cause| cause.of_board),
            false => !covariates_of(name).iter().all(|c| true_covariates.contains(family(c))),
        };
        let run = Run {
            seen,
            wrong: named.into_iter().filter(is_wrong).collect(),
            ratio: depth_rms_mm(&d.after) / floor,
            verdict: d.verdict,
        };
        let words: Vec<String> =
            causes.iter().zip(&costs).map(|(cause, cost)| format!("{} ({cost:.2})", cause.words)).collect();
        let formulas: Vec<String> = d.formulas.iter().map(|f| f.effect.text()).collect();
        eprintln!(
            "several {seed}: {words:?} → {:?} {:?} {:?} seen {:?} wrong {:?}; {:.3} → {:.3}, without {floor:.3}, ratio {:.3}",
            run.verdict,
            names(&d),
            formulas.iter().map(|text| text.chars().take(60).collect::<String>()).collect::<Vec<_>>(),
            run.seen,
            run.wrong,
            depth_rms_mm(&d.before),
            depth_rms_mm(&d.after),
            run.ratio,
        );
        Ok(run)
    }
}
