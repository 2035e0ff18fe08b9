//! Whether the best of all terms is more than the best of so many would be by chance, and whether other frames would have shown the
//! same covariates.

use std::collections::{BTreeMap, BTreeSet};

use depthcal_formula::FormulaCovariate as C;
use depthcal_statistics::mean_to_standard_error;
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use rayon::prelude::*;
use tracing::debug;

use super::exchange::Exchange;
use super::observations::Observations;
use super::score::Score;
use super::screening::{PENALTY, Screened, screen};
use super::term::Term;

/// Signs of frames that are drawn.
const DRAWS: usize = 399;
/// Resamples of the frames.
const RESAMPLES: usize = 100;
/// A term of fewer covariates wins where it is worse than the best by less than this many standard errors over frames …
const TIE_T: f64 = 2.0;
/// … and not by more than this share.
const LEAST_SHARE: f64 = 0.8;

/// p-value of the best of all terms: how often any term is as good where the signs of the frames' scores are drawn at random, without what
/// the term itself explains of them. What frames do not share stays; what they share is left out, so that an effect does not hide itself
/// (unrestricted wild cluster bootstrap; Cameron, Gelbach, Miller 2008; MacKinnon, Webb 2018).
///
/// `by_chance` are the same terms under a model that leaves nothing but pure error, where there is one: its residuals are then what signs
/// are drawn for. Under a model that lacks an effect every term shares the effect's residuals, and chance seems to explain more.
pub(super) fn p_value(screened: &[Screened], by_chance: Option<&[Screened]>) -> f64 {
    let best = screened.par_iter().map(|s| s.merit(|_| 1.0)).reduce(|| f64::MIN, f64::max);
    let by_chance = by_chance.filter(|terms| !terms.is_empty()).unwrap_or(screened);
    let groups = by_chance.first().map_or(0, |s| s.parts.len());
    let draws: Vec<Vec<f64>> = {
        let mut random = StdRng::seed_from_u64(17);
        (0..DRAWS).map(|_| (0..groups).map(|_| if random.random::<bool>() { 1.0 } else { -1.0 }).collect()).collect()
    };
    let as_good = draws.par_iter().filter(|signs| by_chance.iter().any(|s| s.merit_by_chance(signs) >= best)).count();
    (as_good + 1) as f64 / (DRAWS + 1) as f64
}

/// The best term for weights of the frames; of terms that are nearly as good one with the fewest covariates. A simpler shape is no reason to
/// take other covariates.
fn best(screened: &[Screened], weights: &[f64]) -> Option<usize> {
    let merits: Vec<f64> = screened.iter().map(|s| s.merit(|i| weights[i])).collect();
    let most = merits.iter().copied().fold(f64::MIN, f64::max);
    let first = merits.iter().position(|merit| *merit == most)?;
    let effort = |i: usize| screened[i].term.families().len();
    let of_best = screened[first].contributions(weights);
    let is_as_good = |i: &usize| {
        let lost: Vec<f64> =
            of_best.iter().zip(screened[*i].contributions(weights)).map(|(best, own)| best - own).collect();
        mean_to_standard_error(&lost) < TIE_T
    };
    let near = (0..screened.len()).filter(|i| merits[*i] >= LEAST_SHARE * most && effort(*i) < effort(first));
    let simpler =
        near.filter(is_as_good).min_by(|a, b| effort(*a).cmp(&effort(*b)).then(merits[*b].total_cmp(&merits[*a])));
    Some(simpler.unwrap_or(first))
}

/// How often which covariates are those of the best term, over resamples of the frames.
pub(super) struct Stability {
    screened: Vec<Screened>,
    weights: Vec<Vec<f64>>,
}

impl Stability {
    /// The terms of the library, those with `refined` constants, and resamples.
    pub fn new(observations: &Observations, refined: &[&Term]) -> Self {
        let mut screened = screen(observations);
        let groups = screened.first().map_or(0, |s| s.parts.len());
        let more: Vec<Screened> =
            refined.par_iter().filter_map(|term| Screened::of(observations, term, groups)).collect();
        screened.extend(more);
        let mut random = StdRng::seed_from_u64(23);
        let weights = (0..RESAMPLES)
            .map(|_| {
                let mut weights = vec![0.0; groups];
                (0..groups).for_each(|_| weights[random.random_range(0..groups)] += 1.0);
                weights
            })
            .collect();
        Self { screened, weights }
    }

    /// Share of resamples in which the best term has the same families of covariates as a term, or with one of the exchanges those that
    /// these frames do not tell from them. For a sum of products those resamples count in which it is better than any other term.
    pub fn of(&self, observations: &Observations, found: &Term, exchanges: &[Exchange]) -> f64 {
        let of_sum =
            (found.products.len() > 1).then(|| Score::of(&observations.normals(found), observations.shared)).flatten();
        let families = found.families();
        let counts = self.counts(|weights, merit| {
            // A sum is not among the terms that are screened.
            let of_sum = of_sum.as_ref()?;
            let (frames, groups) = (of_sum.parts.len(), weights.len());
            let statistic = of_sum.statistic(|frame| weights[frame * groups / frames]);
            (statistic - PENALTY * (found.columns() as f64 - 1.0) >= merit).then(|| families.clone())
        });
        debug!("formulas: best of resamples {counts:?}");
        let of = |set: &BTreeSet<C>| counts.get(set).copied().unwrap_or(0);
        let alike: usize = exchanges.iter().map(|exchange| of(&exchange.of(&families))).sum();
        (of(&families) + alike) as f64 / RESAMPLES as f64
    }

    /// The covariates that are those of the best term most often.
    pub fn most_frequent(&self) -> Option<BTreeSet<C>> {
        let counts = self.counts(|_, _| None);
        counts.into_iter().max_by_key(|(_, count)| *count).map(|(families, _)| families)
    }

    /// Resamples by the covariates of their best term, or those that `instead` gives for their weights and its merit.
    fn counts(&self, instead: impl Fn(&[f64], f64) -> Option<BTreeSet<C>> + Sync) -> BTreeMap<BTreeSet<C>, usize> {
        let families_of = |weights: &Vec<f64>| {
            let found = &self.screened[best(&self.screened, weights)?];
            Some(instead(weights, found.merit(|group| weights[group])).unwrap_or_else(|| found.term.families()))
        };
        let best: Vec<BTreeSet<C>> = self.weights.par_iter().filter_map(families_of).collect();
        let mut counts = BTreeMap::new();
        best.into_iter().for_each(|set| *counts.entry(set).or_default() += 1);
        counts
    }
}
