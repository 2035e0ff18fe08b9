//! How much the rates depend on each threshold: at half and at double its value, over the same captures.

use depthcal::calibration::diagnose::{CameraDiagnoseOptions, Thresholds, diagnose_camera};
use depthcal::calibration::observe::CameraFrames;
use depthcal::io::Verdict;
use depthcal_simulate::{Defects, Effect, Noise, catalogue, uncatalogued};
use rayon::prelude::*;

use super::single::detectable_size;
use super::{Failure, Study, names, percent, simulation};

/// A threshold's name, and what gives it a multiple of its value; returns the value that it got.
type Varied = (&'static str, fn(&mut Thresholds, f64) -> String);

/// A threshold that can be varied.
trait Scaled {
    /// Multiplies it. A share that cannot be doubled is brought half way to one.
    fn scale(&mut self, factor: f64) -> String;
}

impl Scaled for f64 {
    fn scale(&mut self, factor: f64) -> String {
        *self = if *self < 1.0 && factor * *self >= 1.0 { 0.5 * (1.0 + *self) } else { factor * *self };
        self.to_string()
    }
}

impl Scaled for usize {
    fn scale(&mut self, factor: f64) -> String {
        *self = (factor * *self as f64).round().max(1.0) as Self;
        self.to_string()
    }
}

/// All but those of formulas.
macro_rules! varied {
    ($($name:ident,)*) => { &[$((stringify!($name), |thresholds, factor| thresholds.$name.scale(factor))),*] };
}

const VARIED: &[Varied] = varied![
    level,
    power,
    values_per_test,
    least_gain_t,
    least_relative_gain,
    least_explained,
    least_explained_of_own,
    least_explained_of_planes,
    plane_scatter,
    distinguishing_t,
    least_placement_gain,
    least_kept_gain,
    clustered_level,
    least_named_share,
    most_competing_functions,
    most_joint_effects,
    least_joint_share,
    most_selection_passes,
    most_rounds,
    most_rejected,
    least_unexplained_share,
    least_shared_share,
    least_held_out_gain_percent,
    most_unweighted_loss_percent,
    plain_share,
    plain_t,
    gross_plane_mm,
    most_exclusion_rounds,
    outlying_plane_of_noise,
    outlying_plane_of_median,
    most_outlying_share,
    own_plane_level,
    own_plane_of_noise,
    many_own_planes,
    exchanged_deviation_ratio,
    least_identical_markers,
    plausible_scale_deviation,
    least_log_amplitude_span,
    least_cos_incidence_span,
    least_time_span_s,
    least_temperature_span_c,
    distinguishing_noncentrality,
    informative_temperature_span_c,
];

/// The kinds of captures.
#[derive(Clone, Copy)]
enum Drawn {
    Known(&'static str),
    Unknown(&'static str),
    Clean,
    HeavyTails,
    BadFrames,
    Exchanged,
}

/// The part of a capture that the model lacks.
enum Lacking {
    Nothing,
    /// Nothing, but so many frames do not belong.
    Frames(usize),
    Known(&'static str),
    Unknown,
}

/// Whether the verdict and the names are right, and whether a name is false.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Outcome {
    right: bool,
    false_name: bool,
}

impl Study {
    /// The captures of the study: an effect of the catalogue in each at the first of the factors, effects that it lacks, none,
    /// and none but frames that do not belong.
    fn captures(&self) -> Vec<(Lacking, CameraFrames)> {
        let factor = self.factors.first().copied().unwrap_or(4.0);
        let known = catalogue().iter().filter(|e| self.wants(e.name)).map(|e| Drawn::Known(e.name));
        let unknown = uncatalogued().iter().map(|e| Drawn::Unknown(e.name));
        let without = [Drawn::Clean, Drawn::HeavyTails, Drawn::BadFrames, Drawn::Exchanged];
        let kinds: Vec<Drawn> = known.chain(unknown).chain(without).collect();
        let all =
            self.numbers().flat_map(|seed| kinds.iter().enumerate().map(move |(k, kind)| (seed + k as u64, *kind)));
        let capture = |(seed, kind): (u64, Drawn)| -> Result<_, Failure> {
            let clean = || simulation(&[], seed);
            let (lacking, simulation) = match kind {
                Drawn::Known(name) => {
                    let size = factor * detectable_size(name, seed)?;
                    (Lacking::Known(name), simulation(&[Effect::new(name, size)?], seed)?)
                }
                Drawn::Unknown(name) => (Lacking::Unknown, simulation(&[Effect::with_default_size(name)?], seed)?),
                Drawn::Clean => (Lacking::Nothing, clean()?),
                Drawn::HeavyTails => {
                    (Lacking::Nothing, clean()?.noise(Noise { tail_dof: Some(3.0), ..Noise::default() }))
                }
                Drawn::BadFrames => {
                    (Lacking::Frames(2), clean()?.defects(Defects { bad_frames: 2, ..Defects::default() }))
                }
                Drawn::Exchanged => {
                    (Lacking::Frames(2), clean()?.defects(Defects { swapped_depth_pairs: 1, ..Defects::default() }))
                }
            };
            Ok((lacking, self.capture(&simulation)?))
        };
        let all: Vec<_> = all.collect();
        all.into_par_iter().filter_map(|c| capture(c).inspect_err(|e| eprintln!("{e}")).ok()).collect()
    }

    fn outcomes(&self, captures: &[(Lacking, CameraFrames)], thresholds: Thresholds) -> Vec<Option<Outcome>> {
        // The rules for formulas have a study of their own, and a formula for what has no name is no false name.
        let options = CameraDiagnoseOptions { thresholds, formulas: false, ..CameraDiagnoseOptions::default() };
        let outcome = |(lacking, capture): &(Lacking, CameraFrames)| {
            let d = diagnose_camera(capture, None, &options).inspect_err(|e| eprintln!("{e}")).ok()?;
            let added: Vec<String> =
                names(&d).into_iter().filter(|n| n != depthcal::calibration::diagnose::FREE_MAP).collect();
            let (right, expected) = match lacking {
                Lacking::Nothing => (d.verdict == Verdict::Adequate, None),
                Lacking::Frames(count) => (d.bad_frames.len() == *count, None),
                Lacking::Known(name) => (added.first().is_some_and(|n| n == name), Some(*name)),
                Lacking::Unknown => (d.verdict == Verdict::Unexplained, None),
            };
            Some(Outcome { right, false_name: added.iter().any(|n| Some(n.as_str()) != expected) })
        };
        captures.par_iter().map(outcome).collect()
    }

    /// The rates at the default thresholds, and at half and double each of them.
    pub fn sensitivity(&self) {
        let captures = self.captures();
        println!(
            "| threshold | value | named first | adequate where nothing is missing | unexplained where unknown | bad frames found | \
             a false name | come out otherwise |"
        );
        println!("|---|---|---|---|---|---|---|---|");
        let plain = self.outcomes(&captures, Thresholds::default());
        let row = |name: &str, value: String, outcomes: &[Option<Outcome>]| {
            let rate = |of: fn(&Lacking) -> bool, what: fn(&Outcome) -> bool| {
                let chosen = captures.iter().zip(outcomes).filter(|((lacking, _), _)| of(lacking));
                let chosen: Vec<&Outcome> = chosen.filter_map(|(_, o)| o.as_ref()).collect();
                percent(chosen.iter().filter(|o| what(o)).count(), chosen.len())
            };
            println!(
                "| {name} | {value} | {} | {} | {} | {} | {} | {} |",
                rate(|l| matches!(l, Lacking::Known(_)), |o| o.right),
                rate(|l| matches!(l, Lacking::Nothing), |o| o.right),
                rate(|l| matches!(l, Lacking::Unknown), |o| o.right),
                rate(|l| matches!(l, Lacking::Frames(_)), |o| o.right),
                rate(|_| true, |o| o.false_name),
                outcomes.iter().zip(&plain).filter(|(varied, plain)| varied != plain).count(),
            );
        };
        row("as they are", String::new(), &plain);
        let wants = |name: &str| self.thresholds.is_empty() || self.thresholds.iter().any(|n| n == name);
        for (name, scale) in VARIED.iter().filter(|(name, _)| wants(name)) {
            for factor in [0.5, 2.0] {
                let mut thresholds = Thresholds::default();
                let value = scale(&mut thresholds, factor);
                row(&format!("`{name}`"), value, &self.outcomes(&captures, thresholds));
            }
        }
    }
}
