//! Covariates that frames hardly tell apart: while a camera warms up its temperature follows the time.

use std::collections::BTreeSet;

use depthcal_formula::FormulaCovariate as C;
use depthcal_model::Of;
use depthcal_statistics::{mean_to_standard_error, rank_correlation};
use tracing::debug;

use super::observations::Observations;
use super::screened::Screened;
use super::selection::Judged;
use super::term::Term;
use crate::diagnose::thresholds::Thresholds;

/// Rank correlation from which one of two covariates may stand for the other.
const ALIKE: f64 = 0.8;
/// Samples over which it is computed, about.
const SAMPLES: usize = 2000;

/// A covariate of a formula, and another with which a formula explains as much.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Exchange {
    /// The covariate of the formula, as its family.
    pub own: C,
    /// The other one.
    pub other: C,
}

impl Exchange {
    /// The covariate of one set and that of another in its place, where all else is equal.
    pub fn between(own: &BTreeSet<C>, other: &BTreeSet<C>) -> Option<Self> {
        let mut only_own = own.difference(other);
        let mut only_other = other.difference(own);
        let exchange = Self { own: *only_own.next()?, other: *only_other.next()? };
        (only_own.next().is_none() && only_other.next().is_none()).then_some(exchange)
    }

    /// Covariates with the other one in the place of the formula's own.
    pub fn of(self, families: &BTreeSet<C>) -> BTreeSet<C> {
        families.iter().map(|c| if *c == self.own { self.other } else { *c }).collect()
    }

    /// Whether one of the two covariates rises or falls with the other.
    pub fn rise_together(self, observations: &Observations, of: Of) -> bool {
        let count = observations.samples().count();
        let samples = observations.frames.iter().flat_map(|frame| &frame.samples).step_by((count / SAMPLES).max(1));
        let values = samples.map(|s| [s.value(self.own, of), s.value(self.other, of)]);
        let known: Vec<[f64; 2]> = values.filter(|v| v.iter().all(|v| v.is_finite())).collect();
        let column = |i: usize| known.iter().map(|v| v[i]).collect::<Vec<f64>>();
        rank_correlation(&column(0), &column(1)).abs() >= ALIKE
    }
}

/// The covariates that may stand for one of a chosen term's: the frames do not tell the best term with it from the chosen one,
/// and one of the two covariates rises or falls with the other.
pub(super) fn exchanges(
    observations: &Observations,
    chosen: &Term,
    others: &[&Term],
    thresholds: &Thresholds,
) -> Vec<Exchange> {
    let families = chosen.families();
    let mut exchanges: Vec<Exchange> = Vec::new();
    for other in others {
        let Some(exchange) = Exchange::between(&families, &other.families()) else { continue };
        if exchanges.contains(&exchange) || !exchange.rise_together(observations, chosen.of) {
            continue;
        }
        let t = certainty(observations, chosen, other);
        debug!("formulas: {:?} in the place of {:?} is worse by {t:.1} standard errors", exchange.other, exchange.own);
        if t < thresholds.distinguishing_t {
            exchanges.push(exchange);
        }
    }
    exchanges
}

/// Standard errors over frames by which one term is better than another: on frames that are left out, or in what they explain of
/// those that they are estimated from, whichever is less certain.
fn certainty(observations: &Observations, term: &Term, other: &Term) -> f64 {
    let judged = |term: &Term| Judged::new(observations, term.clone());
    let held_out = mean_to_standard_error(&judged(term).lost_by(&judged(other)));
    let weights = vec![1.0; observations.frames.len()];
    let explained = |term: &Term| Some(Screened::of(observations, term, weights.len())?.contributions(&weights));
    let Some((of_term, of_other)) = explained(term).zip(explained(other)) else { return held_out };
    let lost: Vec<f64> = of_term.iter().zip(&of_other).map(|(a, b)| a - b).collect();
    held_out.min(mean_to_standard_error(&lost))
}
