//! Formulas for what the catalogue leaves unexplained.
//!
//! A typed library of terms of one and two covariates (`library`, `term`) is scored against the rows of a fit from which poses are
//! eliminated (`observations`, `screening`); the best are refined and compared on left-out frames, and the simpler of equals wins
//! (`selection`). What is found has to be better than the best of so many terms would be by chance, and to have the same covariates in other
//! frames (`significance`), where covariates that rise and fall together count as one (`exchange`); it has to explain nearly what any function of
//! its covariates does (`free`). Places and forms that the frames
//! cannot tell from its own are listed (`places`). Frames that the search has not seen confirm its sign and size, or do not
//! (`confirmation`). Drawn is what the formula describes of the residuals (`component`).

mod component;
mod confirmation;
mod definition;
mod exchange;
mod free;
mod library;
mod observations;
mod places;
mod score;
mod screening;
mod selection;
mod significance;
mod term;

#[cfg(all(test, feature = "simulate"))]
mod null_tests;

use depthcal_formula::FormulaEffect;
use depthcal_io::DiagnosisPlace;
use depthcal_model::{Options, PieceSpec};
use tracing::{debug, info};

pub use self::component::{Component, ComponentBin, components};
use self::confirmation::replicate;
use self::definition::{effect_of, name_of};
use self::exchange::exchanges;
use self::free::gain_of_free_function;
use self::observations::Observations;
use self::places::places_not_told_apart;
use self::screening::screen;
use self::selection::select;
use self::significance::{p_value, stability};
use self::term::Term;
use super::examination::Examination;
use super::thresholds::Thresholds;
use crate::calibrate::Calibrated;

/// A formula that was found, with what speaks for it.
#[derive(Debug, Clone)]
pub struct Discovery {
    /// The formula as an effect.
    pub effect: FormulaEffect,
    /// Names of its covariates, sorted.
    pub covariates: Vec<String>,
    /// Covariates that may stand for one of these: the formula's own, and the other one. The frames do not tell which of them it is.
    pub covariates_not_told_apart: Vec<[String; 2]>,
    /// Place and form.
    pub place: DiagnosisPlace,
    /// Places and forms that the frames cannot tell from it.
    pub places_not_told_apart: Vec<DiagnosisPlace>,
    /// How often the best of all terms explains as much where the signs of the frames are drawn at random.
    pub p_value: f64,
    /// Share of resamples of the frames in which the best term has the same covariates, or ones that are not told apart from them.
    pub stability: f64,
    /// Whether the frames that the search did not see confirm sign and size.
    pub confirmed: bool,
    /// Size in these frames over that in the others, with its standard error.
    pub replication: Option<[f64; 2]>,
    /// Share that it explains of what the best free function of its covariates explains, on left-out frames.
    pub share_of_free_function: f64,
    /// Effects of the catalogue that explain nearly as much.
    pub resembles: Vec<String>,
    /// The best formulas of other covariates.
    pub runners_up: Vec<RunnerUp>,
    /// Number of terms that were scored.
    pub terms: usize,
    /// Effects that it took the place of: they imitated it.
    pub replaced: Vec<PieceSpec>,
    /// What it describes of the residuals of the last model.
    pub components: Vec<Component>,
}

/// A formula that lost.
#[derive(Debug, Clone)]
pub struct RunnerUp {
    /// The formula as an effect.
    pub effect: FormulaEffect,
    /// Names of its covariates, sorted.
    pub covariates: Vec<String>,
    /// What it explains on left-out frames, over what the winner does.
    pub gain_share: f64,
}

/// What a search came to.
#[derive(Debug, Clone)]
pub enum Search {
    /// A formula.
    Found(Box<Discovery>),
    /// None, and why: the best one was refused, or there was none.
    Nothing(String),
}

/// Share of a formula's gain that an effect has to explain to be said to resemble it.
const RESEMBLES: f64 = 0.9;
/// Formulas whose gains are logged.
const TOLD: usize = 12;
/// Formulas that lost and are told.
const RUNNERS_UP: usize = 3;
/// The name of a formula that lost.
pub(super) const RUNNER_UP: &str = "runner_up";
/// Share by which the range of inverse depth is extended when it is checked that depth stays monotone.
const EXTENDED: f64 = 1.3;

/// Searches a formula for what a fit leaves unexplained. Frames of another capture, sampled under the same camera, confirm it; without
/// them a third of the frames is set aside.
pub fn search(
    fit: &Calibrated,
    verify: Option<&Calibrated>,
    examination: &Examination,
    taken: &[String],
    thresholds: &Thresholds,
) -> Search {
    let nothing = |reason: &str| Search::Nothing(reason.to_owned());
    let Some(own) = Observations::of(fit) else { return nothing("the frames cannot be evaluated") };
    if own.frames.len() < thresholds.least_frames_for_formulas {
        return nothing("there are too few frames");
    }
    let all = own.with_set_aside(verify.and_then(Observations::of));
    let searched = all.searched();
    let screened = screen(&searched);
    let p = p_value(&screened);
    info!("formulas: {} terms, the best with p = {p:.3}", screened.len());
    if !(p <= thresholds.level) {
        return Search::Nothing(format!("the best of {} terms could be chance (p = {p:.2})", screened.len()));
    }
    let Some((chosen, others)) = select(&searched, &screened) else {
        return nothing("no term predicts frames that were left out");
    };
    for judged in std::iter::once(&chosen).chain(&others).take(TOLD) {
        if let Ok(effect) = effect_of(&judged.term, "compared", &[]) {
            debug!("formulas: {:.1} by {} ({})", judged.gain(), effect.text(), judged.term.of.words());
        }
    }
    let term = &chosen.term;
    let mut name = name_of(term);
    while taken.contains(&name) {
        name.push_str("_more");
    }
    let Some(theta) = score::estimate(&all.normals(term), all.shared) else {
        return nothing("the best formula is not determined by the frames");
    };
    let effect = match effect_of(term, &name, theta.as_slice()) {
        Ok(effect) => effect,
        Err(error) => return Search::Nothing(error.to_string()),
    };
    // Resamples are of all frames: whether other frames would show the same is no matter of those that were searched.
    let refined: Vec<&Term> = std::iter::once(&chosen).chain(&others).map(|judged| &judged.term).collect();
    let exchanges = exchanges(&all, term, &refined, thresholds);
    let stability = stability(&all, term, &refined, &exchanges);
    info!("formulas: {} ({}), stability {stability:.2}", effect.text(), term.of.words());
    if stability < thresholds.least_stability {
        return Search::Nothing(format!("{} has its covariates in {stability:.2} of resamples only", effect.text()));
    }
    let gain = chosen.gain();
    let share = gain / gain.max(gain_of_free_function(&searched, term));
    if share < thresholds.least_share_of_free_function {
        return Search::Nothing(format!(
            "{} explains {share:.2} of what a free function of its covariates does",
            effect.text()
        ));
    }
    if !is_monotone(&all, &effect, theta.as_slice()) {
        return Search::Nothing(format!("{} makes depth fold", effect.text()));
    }
    let replication = replicate(&all, term);
    let effect_that_lost = |term: &Term| effect_of(term, RUNNER_UP, &[]);
    let mut told = vec![term.families()];
    let mut runners_up = Vec::new();
    for other in &others {
        if runners_up.len() < RUNNERS_UP && !told.contains(&other.term.families()) {
            told.push(other.term.families());
            if let Ok(effect) = effect_that_lost(&other.term) {
                let (covariates, gain_share) = (names(&other.term), other.gain() / gain);
                runners_up.push(RunnerUp { effect, covariates, gain_share });
            }
        }
    }
    let whole_gain: f64 = score::held_out_gains(&all.normals(term), all.shared, None).iter().sum();
    let resembling = examination.effects().filter(|effect| effect.gain() > RESEMBLES * whole_gain);
    Search::Found(Box::new(Discovery {
        covariates: names(term),
        covariates_not_told_apart: exchanges.iter().map(|e| [e.own, e.other].map(|c| c.name().to_owned())).collect(),
        place: DiagnosisPlace { of: term.of, on: term.on },
        places_not_told_apart: places_not_told_apart(&all, term, thresholds),
        p_value: p,
        stability,
        confirmed: replication.is_some_and(|r| r.confirms()),
        replication: replication.map(|r| [r.size, r.standard_error]),
        share_of_free_function: share,
        resembles: resembling.map(|effect| effect.name.clone()).collect(),
        runners_up,
        terms: screened.len(),
        replaced: Vec::new(),
        components: Vec::new(),
        effect,
    }))
}

fn names(term: &Term) -> Vec<String> {
    let mut names: Vec<String> = term.covariates().into_iter().map(|c| c.name().to_owned()).collect();
    names.sort_unstable();
    names
}

/// Whether measured depth grows with true depth under the formula, over the captured range and somewhat beyond.
fn is_monotone(all: &Observations, effect: &FormulaEffect, theta: &[f64]) -> bool {
    let piece = effect.piece(&Options::new());
    let samples = || all.frames.iter().flat_map(|frame| frame.samples.iter().step_by(7));
    let (low, high) =
        samples().fold((f64::INFINITY, 0.0_f64), |(low, high), s| (low.min(s.state[2]), high.max(s.state[2])));
    let rises = |state: [f64; 4], sample: &observations::Sample| {
        let (mut out, mut d) = ([0.0], [0.0; 4]);
        piece.linearize(theta, &state, &[sample.context], &mut out, &mut d, None);
        d[2] > 0.0
    };
    samples().all(|sample| {
        let at = |rho: f64| rises([sample.state[0], sample.state[1], rho, sample.state[3]], sample);
        at(sample.state[2]) && at(low / EXTENDED) && at(high * EXTENDED)
    })
}
