//! Does the loop find what is missing? Simulated captures with an undeclared effect at one, two and four times the size that
//! they can just show, clean ones, and ones with effects that the catalogue does not have; one table.
//!
//! `cargo run --release --example power_study -- --seeds 10 --level points`
//!
//! `--level images` renders images and depth images and detects the board; `--what single,clean,heavy,bad,beyond,pairs`
//! chooses; `--effects a,b` limits the effects.

use std::error::Error;
use std::time::Instant;

use depthcal::calibrate::{CalibrateOptions, calibrate};
use depthcal::capture::{CaptureOptions, load};
use depthcal::diagnose::{DiagnoseOptions, Diagnosis, diagnose, evidence};
use depthcal::observations::Capture;
use depthcal::simulated;
use depthcal_io::Verdict;
use depthcal_simulate::{CameraTruth, Defects, Effect, Kind, Noise, PointOptions, Simulation, catalogue, uncatalogued};
use depthcal_solver::score::noncentrality;
use rayon::prelude::*;

struct Study {
    images: bool,
    seeds: u64,
    effects: Vec<String>,
}

fn simulation(effects: &[Effect], seed: u64) -> Result<Simulation, Box<dyn Error>> {
    Ok(Simulation::new(CameraTruth::published(1)?, Kind::General(1), effects, 100 + seed).unit(seed))
}

impl Study {
    fn capture(&self, simulation: &Simulation) -> Result<Capture, Box<dyn Error>> {
        if !self.images {
            return Ok(simulated::capture(&simulation.observe_points(&PointOptions::default())?));
        }
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("capture");
        simulation.write_dataset(&path)?;
        Ok(load(&path, &CaptureOptions { cache: None, ..CaptureOptions::default() })?.capture)
    }

    fn diagnose(&self, simulation: &Simulation) -> Result<Diagnosis, Box<dyn Error>> {
        Ok(diagnose(&self.capture(simulation)?, None, &DiagnoseOptions::default())?)
    }
}

/// The size of an effect that a capture of this seed shows in 80 % of cases, in the simulator's unit: where the
/// noncentrality of its score test is that of the power asked for.
fn detectable_size(name: &str, default: f64, seed: u64) -> Result<f64, Box<dyn Error>> {
    let mut size = default;
    let mut found = (1.0, 1, 1.0);
    for _ in 0..6 {
        let effect = Effect::new(name, size)?;
        let observed = simulation(&[effect], seed)?.observe_points(&PointOptions::default())?;
        let options = CalibrateOptions::default();
        let fit = calibrate(&simulated::capture(&observed), &options)?;
        let examination = evidence::examine(&fit, &options.register)?;
        let own = examination.effects().find(|e| e.name == name).ok_or("not in the catalogue")?;
        let lambda = (own.score.statistic - own.score.rank as f64).max(1.0);
        let level = evidence::LEVEL / examination.tests as f64;
        found = (lambda, own.score.rank, level);
        if (200.0..800.0).contains(&lambda) {
            break;
        }
        size *= (400.0 / lambda).sqrt().clamp(0.1, 10.0);
    }
    let (lambda, rank, level) = found;
    Ok(size * (noncentrality(rank, level, evidence::POWER) / lambda).sqrt())
}

fn names(d: &Diagnosis) -> Vec<&str> {
    d.steps.iter().map(|s| s.effects[0].as_str()).collect()
}

fn rms(d: &Diagnosis) -> (f64, f64) {
    let of = |h: &depthcal::diagnose::HeldOut| h.errors.depth_rms_mm.unwrap_or(f64::NAN);
    (of(&d.before), of(&d.after))
}

fn percent(n: usize, of: usize) -> String {
    format!("{:.0} %", 100.0 * n as f64 / of.max(1) as f64)
}

impl Study {
    fn single(&self) {
        println!(
            "| effect | size / detectable | named first | named at all | false names | unexplained | other names |"
        );
        println!("|---|---|---|---|---|---|---|");
        for info in catalogue().iter().filter(|e| self.effects.is_empty() || self.effects.iter().any(|n| n == e.name)) {
            for factor in [1.0, 2.0, 4.0] {
                let runs: Vec<(Vec<String>, Verdict)> = (0..self.seeds)
                    .into_par_iter()
                    .filter_map(|seed| {
                        let run = || -> Result<_, Box<dyn Error>> {
                            let size = factor * detectable_size(info.name, info.default_size, seed)?;
                            let d = self.diagnose(&simulation(&[Effect::new(info.name, size)?], seed)?)?;
                            Ok((names(&d).into_iter().map(str::to_owned).collect(), d.verdict))
                        };
                        run().inspect_err(|e| eprintln!("{} seed {seed}: {e}", info.name)).ok()
                    })
                    .collect();
                let n = runs.len();
                let first = runs.iter().filter(|r| r.0.first().is_some_and(|f| f == info.name)).count();
                let at_all = runs.iter().filter(|r| r.0.iter().any(|f| f == info.name)).count();
                let others: Vec<&str> =
                    runs.iter().flat_map(|r| r.0.iter().map(String::as_str)).filter(|f| *f != info.name).collect();
                let wrong = runs.iter().filter(|r| r.0.iter().any(|f| f != info.name)).count();
                let unexplained = runs.iter().filter(|r| r.1 == Verdict::Unexplained).count();
                println!(
                    "| {} | {factor} | {} | {} | {} | {} | {} |",
                    info.name,
                    percent(first, n),
                    percent(at_all, n),
                    percent(wrong, n),
                    percent(unexplained, n),
                    others.join(" ")
                );
            }
        }
    }

    /// Captures in which nothing may be named.
    fn nothing(&self, what: &str, change: impl Fn(Simulation) -> Simulation + Sync) {
        let runs: Vec<(String, Verdict)> = (0..self.seeds)
            .into_par_iter()
            .filter_map(|seed| {
                let run = || -> Result<_, Box<dyn Error>> {
                    let d = self.diagnose(&change(simulation(&[], 1000 + seed)?))?;
                    let bad: Vec<&str> = d.bad_frames.iter().map(|b| b.name.as_str()).collect();
                    Ok((format!("{}[{}]", names(&d).join("+"), bad.join(" ")), d.verdict))
                };
                run().inspect_err(|e| eprintln!("{what} seed {seed}: {e}")).ok()
            })
            .collect();
        let adequate = runs.iter().filter(|r| r.1 == Verdict::Adequate).count();
        let rest: Vec<String> =
            runs.iter().filter(|r| r.1 != Verdict::Adequate).map(|r| format!("{:?} {}", r.1, r.0)).collect();
        println!("{what}: nothing named and nothing left in {} of {}; {}", adequate, runs.len(), rest.join(", "));
        if what.contains("frames") {
            println!("  {}", runs.iter().map(|r| r.0.clone()).collect::<Vec<_>>().join(" "));
        }
    }

    fn beyond(&self) {
        for info in
            uncatalogued().iter().filter(|e| self.effects.is_empty() || self.effects.iter().any(|n| n == e.name))
        {
            let runs: Vec<(String, Verdict, f64, f64)> = (0..self.seeds)
                .into_par_iter()
                .filter_map(|seed| {
                    let run = || -> Result<_, Box<dyn Error>> {
                        let d = self.diagnose(&simulation(&[Effect::with_default_size(info.name)?], seed)?)?;
                        let (before, after) = rms(&d);
                        Ok((names(&d).join("+"), d.verdict, before, after))
                    };
                    run().inspect_err(|e| eprintln!("{} seed {seed}: {e}", info.name)).ok()
                })
                .collect();
            let unexplained = runs.iter().filter(|r| r.1 == Verdict::Unexplained).count();
            let clean =
                runs.iter().filter(|r| r.1 == Verdict::Unexplained && (r.0.is_empty() || r.0 == "free_map")).count();
            let detail: Vec<String> = runs.iter().map(|r| format!("{:?}:{} {:.2}→{:.2}", r.1, r.0, r.2, r.3)).collect();
            println!(
                "{}: unexplained {}, without any name {}; {}",
                info.name,
                percent(unexplained, runs.len()),
                percent(clean, runs.len()),
                detail.join(", ")
            );
        }
    }

    fn pairs(&self) {
        let pairs = [
            ("cyclic_depth", "range_offset"),
            ("board_bow", "reflectivity_bias"),
            ("projector_distortion", "temporal_drift"),
            ("depth_registration", "incidence_bias"),
            ("disparity_ripple", "thin_prism"),
            ("radial_range", "temperature_drift"),
        ];
        for (a, b) in pairs {
            let runs: Vec<Vec<String>> = (0..self.seeds)
                .into_par_iter()
                .filter_map(|seed| {
                    let run = || -> Result<_, Box<dyn Error>> {
                        let default = |name: &str| Effect::with_default_size(name).map(|e| e.size);
                        let effect = |name: &str| -> Result<Effect, Box<dyn Error>> {
                            Ok(Effect::new(name, 4.0 * detectable_size(name, default(name)?, seed)?)?)
                        };
                        let d = self.diagnose(&simulation(&[effect(a)?, effect(b)?], seed)?)?;
                        let mut all: Vec<String> = names(&d).into_iter().map(str::to_owned).collect();
                        all.push(format!("({:?})", d.verdict));
                        Ok(all)
                    };
                    run().inspect_err(|e| eprintln!("{a} and {b} seed {seed}: {e}")).ok()
                })
                .collect();
            let both = runs.iter().filter(|r| r.iter().any(|n| n == a) && r.iter().any(|n| n == b)).count();
            let rest: Vec<String> = runs.iter().map(|r| r.join("+")).collect();
            println!("{a} and {b}: both named {}; {}", percent(both, runs.len()), rest.join(", "));
        }
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let value = |key: &str, default: &str| -> String {
        let at = arguments.iter().position(|a| a == key);
        at.and_then(|i| arguments.get(i + 1)).cloned().unwrap_or_else(|| default.to_owned())
    };
    let list = |text: String| -> Vec<String> { text.split(',').filter(|t| !t.is_empty()).map(str::to_owned).collect() };
    let study = Study {
        images: value("--level", "points") == "images",
        seeds: value("--seeds", "5").parse().unwrap_or(5),
        effects: list(value("--effects", "")),
    };
    let what = list(value("--what", "single,clean,heavy,bad,beyond,pairs"));
    let wants = |name: &str| what.iter().any(|w| w == name);
    let start = Instant::now();
    if wants("single") {
        study.single();
    }
    if wants("clean") {
        study.nothing("clean", |s| s);
    }
    if wants("heavy") {
        study.nothing("heavy-tailed noise", |s| s.noise(Noise { tail_dof: Some(3.0), ..Noise::default() }));
    }
    if wants("bad") {
        study.nothing("two bad frames", |s| s.defects(Defects { bad_frames: 2, ..Defects::default() }));
        study
            .nothing("exchanged depth frames", |s| s.defects(Defects { swapped_depth_pairs: 1, ..Defects::default() }));
        study.nothing("duplicated frames", |s| s.defects(Defects { duplicated_frames: 2, ..Defects::default() }));
        study.nothing("5 % depth outliers", |s| s.defects(Defects { depth_outliers: 0.05, ..Defects::default() }));
    }
    if wants("beyond") {
        study.beyond();
    }
    if wants("pairs") {
        study.pairs();
    }
    eprintln!("{:.0} s", start.elapsed().as_secs_f64());
}
