//! Whether the best of all terms is more than the best of so many would be by chance, and whether other frames would have shown
//! the same covariates.

use std::collections::{BTreeMap, BTreeSet};

use depthcal_formula::FormulaCovariate as C;
use depthcal_statistics::mean_to_standard_error;
use nalgebra::{DMatrix, DVectorView};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use rayon::prelude::*;
use tracing::debug;

use super::exchange::Exchange;
use super::library::MOST_COLUMNS;
use super::observations::Observations;
use super::score::Score;
use super::screened::{PENALTY, Screened, group_of};
use super::term::Term;

/// Signs of frames that are drawn.
pub(super) const DRAWS: usize = 399;
/// Resamples of the frames.
pub(super) const RESAMPLES: usize = 100;
/// A candidate of fewer covariates wins where it is worse than the best by less than this many standard errors over frames …
const TIE_T: f64 = 2.0;
/// … and not by more than this share.
const LEAST_SHARE: f64 = 0.8;

/// p-value of the best of all terms: how often any term is as good where the signs of the frames' scores are drawn at random,
/// without what the term itself explains of them. What frames do not share stays; what they share is left out, so that an effect
/// does not hide itself (unrestricted wild cluster bootstrap; Cameron, Gelbach, Miller 2008; MacKinnon, Webb 2018).
///
/// `by_chance` are the same terms under a model that leaves nothing but pure error, where there is one: its residuals are then
/// what signs are drawn for. Under a model that lacks an effect every term shares the effect's residuals, and chance seems to
/// explain more.
pub(super) fn p_value(screened: &[Screened], by_chance: Option<&[Screened]>) -> f64 {
    let best = screened.par_iter().map(|s| s.merit(|_| 1.0)).reduce(|| f64::MIN, f64::max);
    let by_chance = by_chance.filter(|terms| !terms.is_empty()).unwrap_or(screened);
    let groups = by_chance.first().map_or(0, |s| s.parts.len());
    let signs = signs_of_groups(groups);
    let of_terms = |terms: &[Screened]| best_by_chance(terms, &signs);
    let larger = |a: Vec<f64>, b: Vec<f64>| a.iter().zip(b).map(|(a, b)| a.max(b)).collect();
    let by_draw = by_chance.par_chunks(TERMS_AT_ONCE).map(of_terms).reduce(|| vec![f64::MIN; DRAWS], larger);
    let as_good = by_draw.iter().filter(|merit| **merit >= best).count();
    (as_good + 1) as f64 / (DRAWS + 1) as f64
}

/// Random signs of the groups, one column per draw.
pub(super) fn signs_of_groups(groups: usize) -> DMatrix<f64> {
    let mut random = StdRng::seed_from_u64(17);
    let mut signs = DMatrix::zeros(groups, DRAWS);
    signs.iter_mut().for_each(|sign| *sign = if random.random::<bool>() { 1.0 } else { -1.0 });
    signs
}

/// How often each group is drawn in resamples of them.
pub(super) fn resamples(groups: usize) -> Vec<Vec<f64>> {
    let mut random = StdRng::seed_from_u64(23);
    let resample = |_| {
        let mut weights = vec![0.0; groups];
        (0..groups).for_each(|_| weights[random.random_range(0..groups)] += 1.0);
        weights
    };
    (0..RESAMPLES).map(resample).collect()
}

/// Terms whose merits by chance are computed together.
const TERMS_AT_ONCE: usize = 256;

/// The largest merit of terms for every draw of `signs`, one column each.
fn best_by_chance(terms: &[Screened], signs: &DMatrix<f64>) -> Vec<f64> {
    let mut parts = DMatrix::zeros(MOST_COLUMNS * terms.len(), signs.nrows());
    for (i, term) in terms.iter().enumerate() {
        for (group, part) in term.unexplained().iter().enumerate() {
            parts.fixed_view_mut::<MOST_COLUMNS, 1>(MOST_COLUMNS * i, group).copy_from_slice(part);
        }
    }
    let sums = parts * signs;
    let of_draw = |sums: DVectorView<'_, f64>| {
        let merit = |(i, term): (usize, &Screened)| term.merit_of_sum([0, 1].map(|c| sums[MOST_COLUMNS * i + c]));
        terms.iter().enumerate().map(merit).fold(f64::MIN, f64::max)
    };
    sums.column_iter().map(of_draw).collect()
}

/// The best term for weights of the frames; of terms that are nearly as good one with the fewest covariates. A simpler shape is
/// no reason to take other covariates.
fn best(screened: &[&Screened], weights: &[f64]) -> Option<usize> {
    let merits: Vec<f64> = screened.iter().map(|s| s.merit(|i| weights[i])).collect();
    fewest_of_equals(&merits, |i| screened[i].term.families().len(), |i| screened[i].contributions(weights))
}

/// The best of candidates with these merits; of those that are nearly as good one of the fewest covariates. `covariates` is a
/// candidate's number of covariates, `contributions` what every group of frames contributes to its merit.
pub(super) fn fewest_of_equals(
    merits: &[f64],
    covariates: impl Fn(usize) -> usize,
    contributions: impl Fn(usize) -> Vec<f64>,
) -> Option<usize> {
    let most = merits.iter().copied().fold(f64::MIN, f64::max);
    let first = merits.iter().position(|merit| *merit == most)?;
    let of_best = contributions(first);
    let is_as_good = |i: &usize| {
        let lost: Vec<f64> = of_best.iter().zip(contributions(*i)).map(|(best, own)| best - own).collect();
        mean_to_standard_error(&lost) < TIE_T
    };
    let near = (0..merits.len()).filter(|i| merits[*i] >= LEAST_SHARE * most && covariates(*i) < covariates(first));
    let simpler = near
        .filter(is_as_good)
        .min_by(|a, b| covariates(*a).cmp(&covariates(*b)).then(merits[*b].total_cmp(&merits[*a])));
    Some(simpler.unwrap_or(first))
}

/// How often which covariates are those of the best term, over resamples of the frames.
pub(super) struct Stability {
    resamples: Vec<Resample>,
}

/// The best term of a resample.
struct Resample {
    /// How often each group of frames was drawn.
    weights: Vec<f64>,
    families: BTreeSet<C>,
    merit: f64,
}

impl Stability {
    /// The best of the terms of the library and of those with `refined` constants in resamples of the frames.
    pub fn new(observations: &Observations, of_library: &[Screened], refined: &[&Term]) -> Self {
        let groups = of_library.first().map_or(0, |s| s.parts.len());
        let refined: Vec<Screened> =
            refined.par_iter().filter_map(|term| Screened::of(observations, term, groups)).collect();
        let screened: Vec<&Screened> = of_library.iter().chain(&refined).collect();
        let of_resample = |weights: Vec<f64>| {
            let best = screened[best(&screened, &weights)?];
            let merit = best.merit(|group| weights[group]);
            Some(Resample { weights, families: best.term.families(), merit })
        };
        Self { resamples: resamples(groups).into_par_iter().filter_map(of_resample).collect() }
    }

    /// Share of resamples in which the best term has the same families of covariates as a term, or with one of the exchanges
    /// those that these frames do not tell from them. For a sum of products those resamples count in which it is better than any
    /// other term.
    pub fn of(&self, observations: &Observations, found: &Term, exchanges: &[Exchange]) -> f64 {
        let of_sum =
            (found.products.len() > 1).then(|| Score::of(&observations.normals(found), observations.shared)).flatten();
        let families = found.families();
        // A sum is not among the terms that are screened.
        let is_better = |resample: &Resample| {
            of_sum.as_ref().is_some_and(|of_sum| {
                let (frames, groups) = (of_sum.parts.len(), resample.weights.len());
                let statistic = of_sum.statistic(|frame| resample.weights[group_of(frame, frames, groups)]);
                statistic - PENALTY * (found.columns() as f64 - 1.0) >= resample.merit
            })
        };
        let counts = self.counts(|resample| if is_better(resample) { &families } else { &resample.families });
        debug!("formulas: best of resamples {counts:?}");
        let count = |set: &BTreeSet<C>| counts.get(set).copied().unwrap_or(0);
        let alike: usize = exchanges.iter().map(|exchange| count(&exchange.of(&families))).sum();
        (count(&families) + alike) as f64 / RESAMPLES as f64
    }

    /// The covariates that are those of the best term most often.
    pub fn most_frequent(&self) -> Option<BTreeSet<C>> {
        let counts = self.counts(|resample| &resample.families);
        counts.into_iter().max_by_key(|(_, count)| *count).map(|(families, _)| families.clone())
    }

    fn counts<'a>(&'a self, families: impl Fn(&'a Resample) -> &'a BTreeSet<C>) -> BTreeMap<&'a BTreeSet<C>, usize> {
        let mut counts = BTreeMap::new();
        self.resamples.iter().for_each(|resample| *counts.entry(families(resample)).or_default() += 1);
        counts
    }
}
