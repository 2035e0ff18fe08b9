//! How much the rates depend on each threshold: at half and at double its value, over the same captures.

use depthcal::calibration::diagnose::{DiagnoseOptions, Thresholds, diagnose};
use depthcal::calibration::observe::Capture;
use depthcal::io::Verdict;
use depthcal_simulate::{Effect, Noise, catalogue, uncatalogued};
use rayon::prelude::*;

use super::single::detectable_size;
use super::{Failure, Study, names, percent, simulation};

/// A threshold's name and its place.
type Varied = (&'static str, fn(&mut Thresholds) -> &mut f64);

/// Those that decide what is named and what is reported as left over.
const VARIED: [Varied; 20] = [
    ("level", |t| &mut t.level),
    ("values_per_test", |t| &mut t.values_per_test),
    ("least_gain_t", |t| &mut t.least_gain_t),
    ("least_relative_gain", |t| &mut t.least_relative_gain),
    ("least_explained", |t| &mut t.least_explained),
    ("least_explained_of_own", |t| &mut t.least_explained_of_own),
    ("least_explained_of_planes", |t| &mut t.least_explained_of_planes),
    ("distinguishing_t", |t| &mut t.distinguishing_t),
    ("least_placement_gain", |t| &mut t.least_placement_gain),
    ("least_kept_gain", |t| &mut t.least_kept_gain),
    ("clustered_level", |t| &mut t.clustered_level),
    ("least_named_share", |t| &mut t.least_named_share),
    ("least_joint_share", |t| &mut t.least_joint_share),
    ("least_unexplained_share", |t| &mut t.least_unexplained_share),
    ("least_shared_share", |t| &mut t.least_shared_share),
    ("least_held_out_gain_percent", |t| &mut t.least_held_out_gain_percent),
    ("most_unweighted_loss_percent", |t| &mut t.most_unweighted_loss_percent),
    ("plain_share", |t| &mut t.plain_share),
    ("plain_t", |t| &mut t.plain_t),
    ("many_own_planes", |t| &mut t.many_own_planes),
];

/// What a capture has that the model lacks.
enum Lacking {
    Nothing,
    Known(&'static str),
    Unknown,
}

/// Whether the verdict and the names are right, and whether a name is false.
#[derive(Clone, Copy)]
struct Outcome {
    right: bool,
    false_name: bool,
}

impl Study {
    /// The captures of the study: an effect of the catalogue in each at the first of the factors, effects that it lacks, and none.
    fn captures(&self) -> Vec<(Lacking, Capture)> {
        let factor = self.factors.first().copied().unwrap_or(4.0);
        let known = catalogue().iter().filter(|e| self.wants(e.name)).map(|e| Some((e.name, true)));
        let unknown = uncatalogued().iter().map(|e| Some((e.name, false)));
        let kinds: Vec<Option<(&'static str, bool)>> = known.chain(unknown).chain([None, None]).collect();
        let all = self.numbers().flat_map(|seed| kinds.iter().enumerate().map(move |(k, kind)| (seed, k, *kind)));
        let capture = |(seed, k, kind): (u64, usize, Option<(&'static str, bool)>)| -> Result<_, Failure> {
            let of = |effects: &[Effect]| simulation(effects, seed + k as u64);
            Ok(match kind {
                Some((name, true)) => {
                    let size = factor * detectable_size(name, seed + k as u64)?;
                    (Lacking::Known(name), self.capture(&of(&[Effect::new(name, size)?])?)?)
                }
                Some((name, false)) => (Lacking::Unknown, self.capture(&of(&[Effect::with_default_size(name)?])?)?),
                None if k % 2 == 0 => (Lacking::Nothing, self.capture(&of(&[])?)?),
                None => {
                    let heavy = Noise { tail_dof: Some(3.0), ..Noise::default() };
                    (Lacking::Nothing, self.capture(&of(&[])?.noise(heavy))?)
                }
            })
        };
        let all: Vec<_> = all.collect();
        all.into_par_iter().filter_map(|c| capture(c).inspect_err(|e| eprintln!("{e}")).ok()).collect()
    }

    fn outcomes(&self, captures: &[(Lacking, Capture)], thresholds: Thresholds) -> Vec<Option<Outcome>> {
        let options = DiagnoseOptions { thresholds, ..DiagnoseOptions::default() };
        let outcome = |(lacking, capture): &(Lacking, Capture)| {
            let d = diagnose(capture, None, &options).inspect_err(|e| eprintln!("{e}")).ok()?;
            let found: Vec<String> =
                names(&d).into_iter().filter(|n| n != depthcal::calibration::diagnose::FREE_MAP).collect();
            let (right, expected) = match lacking {
                Lacking::Nothing => (d.verdict == Verdict::Adequate, None),
                Lacking::Known(name) => (found.first().is_some_and(|n| n == name), Some(*name)),
                Lacking::Unknown => (d.verdict == Verdict::Unexplained, None),
            };
            Some(Outcome { right, false_name: found.iter().any(|n| Some(n.as_str()) != expected) })
        };
        captures.par_iter().map(outcome).collect()
    }

    /// The rates at the default thresholds, and at half and double each of them.
    pub fn sensitivity(&self) {
        let captures = self.captures();
        println!(
            "| threshold | value | named first | adequate where nothing is missing | unexplained where unknown | a false name |"
        );
        println!("|---|---|---|---|---|---|");
        let row = |name: &str, value: String, thresholds: Thresholds| {
            let outcomes = self.outcomes(&captures, thresholds);
            let rate = |of: fn(&Lacking) -> bool, what: fn(&Outcome) -> bool| {
                let chosen = captures.iter().zip(&outcomes).filter(|((lacking, _), _)| of(lacking));
                let chosen: Vec<&Outcome> = chosen.filter_map(|(_, o)| o.as_ref()).collect();
                percent(chosen.iter().filter(|o| what(o)).count(), chosen.len())
            };
            println!(
                "| {name} | {value} | {} | {} | {} | {} |",
                rate(|l| matches!(l, Lacking::Known(_)), |o| o.right),
                rate(|l| matches!(l, Lacking::Nothing), |o| o.right),
                rate(|l| matches!(l, Lacking::Unknown), |o| o.right),
                rate(|_| true, |o| o.false_name),
            );
        };
        row("as they are", String::new(), Thresholds::default());
        let wants = |name: &str| self.thresholds.is_empty() || self.thresholds.iter().any(|n| n == name);
        for (name, place) in VARIED.into_iter().filter(|(name, _)| wants(name)) {
            for factor in [0.5, 2.0] {
                let mut thresholds = Thresholds::default();
                let value = place(&mut thresholds);
                // A share that cannot be doubled is brought half way to one.
                *value = if *value < 1.0 && factor * *value >= 1.0 { 0.5 * (1.0 + *value) } else { factor * *value };
                let value = format!("{}", *value);
                row(&format!("`{name}`"), value, thresholds);
            }
        }
    }
}
