//! The best formulas of other covariates, which are reported next to the formula that was found.

use super::definition::effect_of;
use super::discovered::{Discovery, RunnerUp};
use super::exchange::{Exchange, exchanges};
use super::observations::Observations;
use super::screening::screen;
use super::selection::{Judged, by_merit, compared};
use super::term::Term;
use crate::calibrate::CalibratedCamera;
use crate::diagnose::thresholds::Thresholds;

/// The name of a formula that lost.
pub(in crate::diagnose) const RUNNER_UP: &str = "runner_up";
/// Formulas that lost and are told.
const RUNNERS_UP: usize = 3;

/// A formula that was searched among those of known covariates. Others were not compared with it: that is done, at the cost of a
/// search among all covariates, once the formula is in a model.
#[derive(Debug, Clone)]
pub struct OfCovariates {
    /// The formula, without rivals.
    pub discovery: Discovery,
    term: Option<Term>,
}

impl From<Discovery> for OfCovariates {
    fn from(discovery: Discovery) -> Self {
        Self { discovery, term: None }
    }
}

impl OfCovariates {
    /// A formula with the term that it says.
    pub(super) fn new(discovery: Discovery, term: Term) -> Self {
        Self { discovery, term: Some(term) }
    }

    /// Tells the formula the best ones of other covariates, and those that may stand for its own, in what a fit leaves that lacks
    /// it.
    pub fn tell_rivals(&self, formula: &mut Discovery, fit: &CalibratedCamera, thresholds: &Thresholds) {
        let Some((term, all)) = self.term.as_ref().zip(Observations::of(fit)) else { return };
        let screened = screen(&all);
        let rivals = compared(&all, &by_merit(&screened));
        let terms: Vec<&Term> = rivals.iter().map(|rival| &rival.term).filter(|other| *other != term).collect();
        formula.covariates_not_told_apart = not_told_apart(&exchanges(&all, term, &terms, thresholds));
        formula.runners_up = runners_up(&Judged::new(&all, term.clone()), &rivals);
        formula.terms += screened.len();
    }
}

/// The covariates of a formula and those that may stand for them.
pub(super) fn not_told_apart(exchanges: &[Exchange]) -> Vec<[String; 2]> {
    exchanges.iter().map(|e| [e.own, e.other].map(|c| c.name().to_owned())).collect()
}

/// The best of `others` for each set of covariates but that of the chosen term.
pub(super) fn runners_up(chosen: &Judged, others: &[Judged]) -> Vec<RunnerUp> {
    let mut told = vec![chosen.term.families()];
    let mut runners_up = Vec::new();
    for other in others {
        if runners_up.len() < RUNNERS_UP && !told.contains(&other.term.families()) {
            told.push(other.term.families());
            if let Ok(effect) = effect_of(&other.term, RUNNER_UP, &[]) {
                let (covariates, gain_share) = (other.term.names(), other.gain() / chosen.gain());
                runners_up.push(RunnerUp { effect, covariates, gain_share });
            }
        }
    }
    runners_up
}
