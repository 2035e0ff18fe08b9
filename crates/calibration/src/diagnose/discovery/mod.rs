//! Formulas for what the catalogue leaves unexplained.
//!
//! Smooth functions of one covariate and of two say which covariates a formula would have (`which_covariates`). A typed library
//! of terms of one and two covariates (`library`, `term`) is scored against the rows of a fit from which poses are eliminated
//! (`observations`, `screening`); the best are refined and compared on left-out frames, and the simpler of equals wins
//! (`selection`). What is found has to be better than the best of so many terms would be by chance, and to have the same
//! covariates in other frames (`significance`), where covariates that rise and fall together count as one (`exchange`); it has to
//! explain nearly what any function of its covariates does (`free`). Places and forms that the frames cannot tell from its own
//! are listed (`places`). Frames that the search has not seen confirm its sign and size, or do not (`confirmation`). Drawn is
//! what the formula describes of the residuals (`component`).

mod additive;
mod component;
mod confirmation;
mod definition;
mod discovered;
mod exchange;
mod free;
mod library;
mod observations;
mod places;
mod rivals;
mod score;
mod screened;
mod screening;
mod selection;
mod significance;
mod term;
mod units;
mod which_covariates;

#[cfg(all(test, feature = "simulate"))]
mod null_tests;

use std::cell::OnceCell;

use depthcal_formula::{FormulaCovariate, FormulaEffect};
use depthcal_io::DiagnosisPlace;
use depthcal_model::Options;
use tracing::{debug, info};

pub use self::additive::{Component, additive_components, effects_of_board, searched};
pub use self::component::components;
use self::confirmation::replicate;
use self::definition::{effect_of, name_of};
pub use self::discovered::{Discovery, RunnerUp};
use self::exchange::{Exchange, exchanges};
use self::free::{gain_of_free_function, without_free_function};
use self::observations::Observations;
use self::places::places_not_told_apart;
pub use self::rivals::OfCovariates;
pub(super) use self::rivals::RUNNER_UP;
use self::rivals::{not_told_apart, runners_up};
use self::screened::Screened;
use self::screening::{screen, screen_products, screen_singles};
use self::selection::{Judged, best_extended, by_merit, choose, compared, compared_of_set};
use self::significance::{Stability, p_value};
use self::term::{Term, family};
pub use self::which_covariates::CovariateSet;
use self::which_covariates::which_covariates;
use super::examination::Examination;
use super::thresholds::Thresholds;
use crate::calibrate::CalibratedCamera;

/// Outcome of a search.
#[derive(Debug, Clone)]
pub enum Search {
    /// A formula.
    Found(Box<Discovery>),
    /// None: the best one was refused, or there was none.
    Nothing(Refused),
}

/// Why there is no formula.
#[derive(Debug, Clone)]
pub struct Refused {
    /// In words.
    pub reason: String,
    /// The two covariates of which a function together explains something for certain, though no formula does.
    pub together: Option<CovariateSet>,
}

/// Residuals in which there is nothing to find, by which it is judged what chance explains.
#[derive(Debug, Clone, Copy)]
pub enum Chance<'a> {
    /// Those of the fit, for every term without what the term itself explains.
    Residuals,
    /// As `Residuals`, where something is left for certain: without what a smooth function of the best term's covariates
    /// explains, too.
    WithoutBest,
    /// Those of a fit of the same frames that leaves nothing unexplained.
    Complete(&'a CalibratedCamera),
}

/// Share of a formula's gain that an effect has to explain to be said to resemble it.
const RESEMBLES: f64 = 0.9;
/// Formulas whose gains are logged.
const TOLD: usize = 12;
/// Share by which the range of inverse depth is extended when it is checked that depth stays monotone.
const EXTENDED: f64 = 1.3;

/// Level of the chance test, over that of acceptance, up to which a search of two thirds of the frames is repeated with all of
/// them.
const REPEATED: f64 = 10.0;

/// Searches a formula for what a fit leaves unexplained. Frames of another capture, sampled under the same camera, confirm it;
/// without them a third of the frames is set aside. Where the others show something, but not what, the search is repeated with
/// all frames: what it finds then nothing confirms.
pub fn search(
    fit: &CalibratedCamera,
    chance: Chance<'_>,
    verify: Option<&CalibratedCamera>,
    examination: &Examination,
    taken: &[String],
    thresholds: &Thresholds,
) -> Search {
    let observed = match enough_frames(fit, thresholds) {
        Ok(observed) => observed,
        Err(reason) => return nothing(reason),
    };
    let complete = if let Chance::Complete(fit) = chance { Observations::of(fit) } else { None };
    let without_best = matches!(chance, Chance::WithoutBest);
    let given = Given { examination, taken, without_best, thresholds };
    let other = verify.and_then(Observations::of);
    let by_chance = match &other {
        Some(_) => complete.clone(),
        None => complete.clone().map(|rest| rest.with_set_aside(None).searched()),
    };
    let mut all = AllFrames::new(observed.with_set_aside(other));
    let (p, outcome) = search_among(&all, by_chance.as_ref(), given);
    match outcome {
        Search::Nothing(_) if verify.is_none() && p <= REPEATED * thresholds.level => {
            info!("formulas: searching with all frames");
            all.search_all();
            search_among(&all, complete.as_ref(), given).1
        }
        outcome => outcome,
    }
}

/// Searches a formula of covariates of which a function is known to explain what a fit leaves, otherwise as [`search`]; `None`
/// where there is none.
pub fn search_of(
    covariates: &[String],
    fit: &CalibratedCamera,
    verify: Option<&CalibratedCamera>,
    examination: &Examination,
    taken: &[String],
    thresholds: &Thresholds,
) -> Option<OfCovariates> {
    let refused = |reason: &str| info!("formulas: none of {}: {reason}", covariates.join(" and "));
    let observed = enough_frames(fit, thresholds).inspect_err(|reason| refused(reason)).ok()?;
    let families = covariates.iter().filter_map(|name| FormulaCovariate::of(name)).map(family).collect();
    let set = CovariateSet { covariates: families, p_value: 0.0, stability: 1.0, share_of_cost: 1.0 };
    let given = Given { examination, taken, without_best: false, thresholds };
    let mut all = AllFrames::new(observed.with_set_aside(verify.and_then(Observations::of)));
    loop {
        let searched = all.observations.searched();
        let screened = screen_singles(&searched, &set.covariates);
        let chosen = chosen_of_set(&searched, &screened, &set, thresholds);
        let formula = chosen.and_then(|chosen| {
            let term = chosen.judged.term.clone();
            Ok(OfCovariates::new(discovery(&all, chosen, given)?, term))
        });
        match formula {
            Ok(formula) => return Some(formula),
            Err(reason) if verify.is_some() || all.are_all_searched() => {
                refused(&reason);
                return None;
            }
            Err(_) => all.search_all(),
        }
    }
}

fn nothing(reason: impl Into<String>) -> Search {
    Search::Nothing(Refused { reason: reason.into(), together: None })
}

/// The observations of a fit, or why no formula is searched in them.
fn enough_frames(fit: &CalibratedCamera, thresholds: &Thresholds) -> Result<Observations, &'static str> {
    let observed = Observations::of(fit).ok_or("the frames cannot be evaluated")?;
    if observed.frames.len() < thresholds.least_frames_for_formulas {
        return Err("there are too few frames");
    }
    Ok(observed)
}

/// The frames of a search, those that are set aside among them.
struct AllFrames {
    observations: Observations,
    screened: OnceCell<Vec<Screened>>,
}

impl AllFrames {
    fn new(observations: Observations) -> Self {
        Self { observations, screened: OnceCell::new() }
    }

    /// The terms of the library with their scores in all frames.
    fn screened(&self) -> &[Screened] {
        self.screened.get_or_init(|| screen(&self.observations))
    }

    /// From now on no frame is set aside.
    fn search_all(&mut self) {
        self.observations.frames.iter_mut().for_each(|frame| frame.is_set_aside = false);
    }

    fn are_all_searched(&self) -> bool {
        self.observations.frames.iter().all(|frame| !frame.is_set_aside)
    }
}

/// Inputs of a search from the rest of the diagnosis.
#[derive(Clone, Copy)]
struct Given<'a> {
    examination: &'a Examination,
    taken: &'a [String],
    /// As [`Chance::WithoutBest`].
    without_best: bool,
    thresholds: &'a Thresholds,
}

/// The terms without what a smooth function of the best term's covariates explains: this would count as chance for all terms
/// else.
fn without_best(searched: &Observations, screened: &[Screened]) -> Option<Vec<Screened>> {
    let merit = |s: &Screened| s.merit(|_| 1.0);
    let best = screened.iter().max_by(|a, b| merit(a).total_cmp(&merit(b)))?;
    without_free_function(searched, &best.term).map(|rest| screen(&rest))
}

/// A formula for the residuals of the frames that are not set aside, and how often chance explains as much.
///
/// Where a smooth function of some covariates is best for certain, the formula is searched among the functions of these, or all
/// their products; else, or where none of these will do, among all terms of the library.
fn search_among(all: &AllFrames, by_chance: Option<&Observations>, given: Given<'_>) -> (f64, Search) {
    let thresholds = given.thresholds;
    let searched = all.observations.searched();
    let of_searched: Vec<Screened>;
    let screened = if all.are_all_searched() {
        all.screened()
    } else {
        of_searched = screen(&searched);
        &of_searched
    };
    let set = which_covariates(&searched);
    let certain = set.as_ref().filter(|set| set.is_certain(thresholds));
    let together = certain.filter(|set| set.covariates.len() > 1).cloned();
    let mut reasons = Vec::new();
    if let Some(set) = certain {
        let chosen = chosen_of_set(&searched, screened, set, thresholds);
        match chosen.and_then(|chosen| discovery(all, chosen, given)) {
            Ok(found) => return (set.p_value, Search::Found(Box::new(found))),
            Err(reason) => reasons.push(reason),
        }
    }
    let by_chance = match by_chance {
        Some(complete) => Some(screen(complete)),
        None if given.without_best => without_best(&searched, screened),
        None => None,
    };
    let p = p_value(screened, by_chance.as_deref());
    info!("formulas: {} terms, the best with p = {p:.3}", screened.len());
    if p <= thresholds.level {
        let chosen = chosen_of_all(all, &searched, screened, p, set.as_ref(), thresholds);
        match chosen.and_then(|chosen| discovery(all, chosen, given)) {
            Ok(found) => return (p, Search::Found(Box::new(found))),
            Err(reason) => reasons.push(reason),
        }
    } else {
        reasons.push(format!("the best of {} terms could be chance (p = {p:.2})", screened.len()));
    }
    let least = set.map_or(p, |set| p.min(set.p_value));
    (least, Search::Nothing(Refused { reason: reasons.join("; "), together }))
}

/// A term that was chosen, with what speaks for its covariates.
struct Chosen {
    judged: Judged,
    /// Gain of a free function of its covariates on left-out frames.
    of_free_function: f64,
    /// The others that were compared, the best first.
    others: Vec<Judged>,
    exchanges: Vec<Exchange>,
    p_value: f64,
    stability: f64,
    /// Number of terms that were scored.
    terms: usize,
}

/// The best function of a covariate that is known, or product of functions of two; what speaks for them is that a smooth function
/// of them is best.
fn chosen_of_set(
    searched: &Observations,
    screened: &[Screened],
    set: &CovariateSet,
    thresholds: &Thresholds,
) -> Result<Chosen, String> {
    let mut covariates = set.covariates.iter();
    let products = match (covariates.next(), covariates.next()) {
        (Some(first), Some(second)) => screen_products(searched, *first, *second),
        _ => Vec::new(),
    };
    let of_set = |s: &&Screened| s.term.families().is_subset(&set.covariates);
    let candidates: Vec<&Screened> = products.iter().chain(screened.iter().filter(of_set)).collect();
    let order = by_merit(candidates);
    let mut judged = compared_of_set(searched, &order, &set.covariates);
    let chosen = choose(searched, &order, &judged, None);
    let mut chosen = chosen.ok_or_else(|| format!("no term of {} predicts frames that were left out", set.words()))?;
    let mut of_free_function = gain_of_free_function(searched, &chosen.term);
    let least = thresholds.least_share_of_free_function * of_free_function;
    if chosen.gain() < least
        && let Some(other) = best_extended(searched, &order, &judged).find(|other| other.gain() >= least)
    {
        of_free_function = gain_of_free_function(searched, &other.term);
        chosen = other;
    }
    judged.retain(|other| other.term != chosen.term);
    let terms = screened.len() + products.len();
    let (p_value, stability) = (set.p_value, set.stability);
    Ok(Chosen { judged: chosen, of_free_function, others: judged, exchanges: Vec::new(), p_value, stability, terms })
}

/// The formula that is chosen of all screened terms, where its covariates are stable: in other frames it would have them too, or
/// a smooth function of them would be the best.
fn chosen_of_all(
    frames: &AllFrames,
    searched: &Observations,
    screened: &[Screened],
    p: f64,
    set: Option<&CovariateSet>,
    thresholds: &Thresholds,
) -> Result<Chosen, String> {
    let all = &frames.observations;
    let order = by_merit(screened);
    let judged = compared(searched, &order);
    let simplest = choose(searched, &order, &judged, None);
    let simplest = simplest.ok_or_else(|| "no term predicts frames that were left out".to_owned())?;
    for judged in std::iter::once(&simplest).chain(&judged).take(TOLD) {
        if let Ok(effect) = effect_of(&judged.term, "compared", &[]) {
            debug!("formulas: {:.1} by {} ({})", judged.gain(), effect.text(), judged.term.of.words());
        }
    }
    // Resamples are of all frames: whether other frames would show the same is no matter of those that were searched.
    let resampled = {
        let refined: Vec<&Term> = std::iter::once(&simplest).chain(&judged).map(|judged| &judged.term).collect();
        Stability::new(all, frames.screened(), &refined)
    };
    let with_stability = |chosen: Judged| {
        let others: Vec<&Term> = judged.iter().map(|judged| &judged.term).filter(|t| **t != chosen.term).collect();
        let exchanges = exchanges(all, &chosen.term, &others, thresholds);
        let families = chosen.term.families();
        let of_set = set.filter(|set| set.covariates == families).map_or(0.0, |set| set.stability);
        let share = resampled.of(all, &chosen.term, &exchanges).max(of_set);
        info!("formulas: {:?}, stability {share:.2}", chosen.term.names());
        (chosen, exchanges, share)
    };
    let mut best = with_stability(simplest);
    // The simplest of those that predict alike, but other frames would have shown other covariates.
    let of_set = set.map(|set| set.covariates.clone());
    for families in of_set.into_iter().chain(resampled.most_frequent()) {
        if best.2 < thresholds.least_stability
            && families != best.0.term.families()
            && let Some(chosen) = choose(searched, &order, &judged, Some(&families))
        {
            let other = with_stability(chosen);
            if other.2 >= thresholds.least_stability {
                best = other;
            }
        }
    }
    let (chosen, exchanges, stability) = best;
    if stability < thresholds.least_stability {
        let text = effect_of(&chosen.term, "refused", &[]).map_err(|error| error.to_string())?.text();
        return Err(format!("{text} has its covariates in {stability:.2} of resamples only"));
    }
    let others = judged.iter().filter(|other| other.term != chosen.term).cloned().collect();
    let of_free_function = gain_of_free_function(searched, &chosen.term);
    Ok(Chosen { judged: chosen, of_free_function, others, exchanges, p_value: p, stability, terms: screened.len() })
}

/// A chosen term as a formula, where it explains enough and can be inverted; else the reason why not.
fn discovery(frames: &AllFrames, chosen: Chosen, given: Given<'_>) -> Result<Discovery, String> {
    let Given { examination, taken, thresholds, .. } = given;
    let all = &frames.observations;
    let term = &chosen.judged.term;
    let mut name = name_of(term);
    while taken.contains(&name) {
        name.push_str("_more");
    }
    let theta = score::estimate(&all.normals(term), all.shared)
        .ok_or_else(|| "the best formula is not determined by the frames".to_owned())?;
    let effect = effect_of(term, &name, theta.as_slice()).map_err(|error| error.to_string())?;
    info!("formulas: {} ({})", effect.text(), term.of.words());
    let gain = chosen.judged.gain();
    let share = gain / gain.max(chosen.of_free_function);
    if share < thresholds.least_share_of_free_function {
        return Err(format!("{} explains {share:.2} of what a free function of its covariates does", effect.text()));
    }
    if !is_monotone(all, &effect, theta.as_slice()) {
        return Err(format!("{} makes depth fold", effect.text()));
    }
    let replication = replicate(all, term);
    let whole_gain: f64 = score::held_out_gains(&all.normals(term), all.shared, None).iter().sum();
    let resembling = examination.effects().filter(|effect| effect.gain() > RESEMBLES * whole_gain);
    Ok(Discovery {
        covariates: term.names(),
        covariates_not_told_apart: not_told_apart(&chosen.exchanges),
        place: DiagnosisPlace { of: term.of, on: term.on },
        places_not_told_apart: places_not_told_apart(all, term, thresholds),
        p_value: chosen.p_value,
        stability: chosen.stability,
        confirmed: replication.is_some_and(|r| r.confirms()),
        replication: replication.map(|r| [r.size, r.standard_error]),
        share_of_free_function: share,
        resembles: resembling.map(|effect| effect.name.clone()).collect(),
        runners_up: runners_up(&chosen.judged, &chosen.others),
        terms: chosen.terms,
        replaced: Vec::new(),
        components: Vec::new(),
        effect,
    })
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
        let rises_at = |rho: f64| rises([sample.state[0], sample.state[1], rho, sample.state[3]], sample);
        rises_at(sample.state[2]) && rises_at(low / EXTENDED) && rises_at(high * EXTENDED)
    })
}
