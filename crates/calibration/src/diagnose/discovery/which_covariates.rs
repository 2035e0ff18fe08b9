//! Which covariates a function of what is left would be of, whatever its shape: smooth functions of one covariate and of two
//! together, compared on left-out frames. A product of two shapes resembles no term of the library enough to win among thousands,
//! but a smooth function of its two covariates does.

use std::collections::{BTreeMap, BTreeSet};

use depthcal_formula::FormulaCovariate as C;
use depthcal_model::{Of, On};
use depthcal_solver::additive::{Normal, smoothness_precision};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rayon::prelude::*;
use tracing::{debug, info};

use super::exchange::Exchange;
use super::free::FreeFunction;
use super::observations::Observations;
use super::score::{Score, smooth_gains};
use super::screened::{LEAST_AGREEMENT, MOST_GROUPS, group_of};
use super::significance::{DRAWS, RESAMPLES, fewest_of_equals, resamples, signs_of_groups};
use crate::diagnose::thresholds::Thresholds;

/// One covariate of every family that captures tell apart.
const COVARIATES: [C; 8] = [C::X, C::Y, C::R, C::Z, C::Incidence, C::Amplitude, C::Time, C::Temperature];
/// Basis functions over one covariate, and along each of two.
const ALONE: usize = 16;
const PAIRED: usize = 7;
/// Strength of the smoothness, relative to the information, with which functions are held against chance.
const STRENGTH: f64 = 1e-2;

/// A set of one or two covariates of which a function explains what is left.
#[derive(Debug, Clone, PartialEq)]
pub struct CovariateSet {
    /// The covariates, each for its family.
    pub covariates: BTreeSet<C>,
    /// How often chance makes a function of any set as good.
    pub p_value: f64,
    /// Share of resamples of the frames in which the same set is best.
    pub stability: f64,
    /// Share of the squared residuals of left-out frames that the function explains.
    pub share_of_cost: f64,
}

impl CovariateSet {
    /// Whether it is more than chance, in other frames too, and not negligible. Formulas are accepted in two ways: half of the
    /// level is for each.
    pub(super) fn is_certain(&self, thresholds: &Thresholds) -> bool {
        self.p_value <= 0.5 * thresholds.level
            && self.stability >= thresholds.least_stability
            && self.share_of_cost >= thresholds.least_unexplained_share
    }

    /// Its covariates in words.
    pub(super) fn words(&self) -> String {
        let names: Vec<&str> = self.covariates.iter().map(|c| c.name()).collect();
        names.join(" and ")
    }
}

/// Smooth functions of all sets.
struct Functions {
    functions: Vec<Smooth>,
}

/// A smooth function of a set of covariates in a form.
struct Smooth {
    covariates: BTreeSet<C>,
    /// Gain on every group of frames when it is estimated from the others.
    gains: Vec<f64>,
    /// Its statistic in standard deviations of what chance makes: as observed, and for every draw of signs.
    observed: f64,
    by_chance: Vec<f64>,
}

/// The best set of covariates; `None` where no smooth function predicts left-out frames.
pub(super) fn which_covariates(observations: &Observations) -> Option<CovariateSet> {
    let all = Functions::of(observations);
    let groups = all.functions.first()?.gains.len();
    let best = all.best(&vec![1.0; groups])?;
    let observed = all.functions.iter().map(|f| f.observed).fold(f64::MIN, f64::max);
    let of_draw = |draw: usize| all.functions.iter().map(|f| f.by_chance[draw]).fold(f64::MIN, f64::max);
    let as_good = (0..DRAWS).filter(|draw| of_draw(*draw) >= observed).count();
    let mut counts: BTreeMap<&BTreeSet<C>, usize> = BTreeMap::new();
    for set in resamples(groups).iter().filter_map(|weights| all.best(weights)) {
        *counts.entry(&set.covariates).or_default() += 1;
    }
    debug!("covariates: best of resamples {counts:?}");
    let stable: usize =
        counts.iter().filter(|(set, _)| is_alike(observations, set, &best.covariates)).map(|(_, n)| n).sum();
    let cost: f64 = observations.frames.iter().map(|frame| frame.rows.cost()).sum();
    let set = CovariateSet {
        covariates: best.covariates.clone(),
        p_value: (as_good + 1) as f64 / (DRAWS + 1) as f64,
        stability: stable as f64 / RESAMPLES as f64,
        share_of_cost: best.gains.iter().sum::<f64>() / cost,
    };
    info!("covariates: {set:?}");
    Some(set)
}

/// Whether a set is another one, or has in the place of one of its covariates one that rises or falls with it.
fn is_alike(observations: &Observations, set: &BTreeSet<C>, other: &BTreeSet<C>) -> bool {
    let exchange = || Exchange::between(set, other);
    set == other || exchange().is_some_and(|exchange| exchange.rise_together(observations, Of::True))
}

impl Functions {
    fn of(observations: &Observations) -> Self {
        let known = observations.with_quantities(&COVARIATES);
        let known: Vec<C> = known.into_iter().filter(|c| observations.span(*c, Of::True).is_some()).collect();
        let mut sets: Vec<(Vec<C>, On)> = Vec::new();
        let mut add = |covariates: Vec<C>| {
            // Forms differ by powers of depth: a function of depth has them all.
            let forms: &[On] = if covariates.contains(&C::Z) { &[On::InverseDepth] } else { &On::ALL };
            forms.iter().for_each(|on| sets.push((covariates.clone(), *on)));
        };
        for (i, first) in known.iter().enumerate() {
            add(vec![*first]);
            known[i + 1..].iter().for_each(|second| add(vec![*first, *second]));
        }
        let groups = observations.frames.len().min(MOST_GROUPS);
        let signs = signs_of_groups(groups);
        let smooth = |(covariates, on): (Vec<C>, On)| {
            let count = if covariates.len() == 1 { ALONE } else { PAIRED };
            let function = FreeFunction::of_covariates(observations, &covariates, Of::True, on, count)?;
            Smooth::of(observations, &function, covariates, groups, &signs)
        };
        Self { functions: sets.into_par_iter().filter_map(smooth).collect() }
    }

    /// The best function for weights of the groups; of those that are nearly as good one of the fewest covariates.
    fn best(&self, weights: &[f64]) -> Option<&Smooth> {
        let contributions = |f: usize| -> Vec<f64> {
            self.functions[f].gains.iter().zip(weights).map(|(gain, weight)| gain * weight).collect()
        };
        let gains: Vec<f64> = (0..self.functions.len()).map(|f| contributions(f).iter().sum()).collect();
        let best = fewest_of_equals(&gains, |f| self.functions[f].covariates.len(), contributions)?;
        Some(&self.functions[best]).filter(|_| gains.iter().any(|gain| *gain > 0.0))
    }
}

impl Smooth {
    fn of(
        observations: &Observations,
        function: &FreeFunction,
        covariates: Vec<C>,
        groups: usize,
        signs: &DMatrix<f64>,
    ) -> Option<Self> {
        let (shared, frames) = (observations.shared, observations.frames.len());
        let of_frames = observations.normals_of(|frame| function.columns(frame));
        let mut normals: Vec<Normal> = Vec::with_capacity(groups);
        for (frame, normal) in of_frames.into_iter().enumerate() {
            match normals.get_mut(group_of(frame, frames, groups)) {
                Some(sum) => sum.add(&normal),
                None => normals.push(normal),
            }
        }
        let precision = smoothness_precision(function.axes());
        let gains = smooth_gains(&normals, shared, &precision)?;
        let score = Score::of(&normals, shared)?;
        let information: Vec<DMatrix<f64>> =
            normals.iter().map(|normal| score.information_of(normal, shared)).collect();
        let prior = &precision * (STRENGTH * score.information.trace() / precision.trace());
        let left_out = score.parts_left_out(&normals, shared);
        let chance = Chance { score: &score, left_out: &left_out, information: &information, prior: &prior };
        let (observed, mut by_chance) = chance.statistics(signs)?;
        let deviation = (by_chance.iter().map(|s| s * s).sum::<f64>() / by_chance.len() as f64).sqrt();
        by_chance.iter_mut().for_each(|s| *s /= deviation);
        Some(Self { covariates: covariates.into_iter().collect(), gains, observed: observed / deviation, by_chance })
    }
}

/// The score of a smooth function, for its distribution by chance.
struct Chance<'a> {
    score: &'a Score,
    /// The parts of the score with the shared columns estimated from the others.
    left_out: &'a [DVector<f64>],
    information: &'a [DMatrix<f64>],
    prior: &'a DMatrix<f64>,
}

impl Chance<'_> {
    /// Cross-group statistic Σᵢ≠ⱼ uᵢᵀ (V + P)⁻¹ uⱼ of the scores, observed and under random signs of the leave-one-out scores:
    /// those that the function, estimated from the other groups, leaves (as [`p_value`](super::significance::p_value) of terms).
    fn statistics(&self, signs: &DMatrix<f64>) -> Option<(f64, Vec<f64>)> {
        let whole = (&self.score.information + self.prior).cholesky()?;
        let statistic = |u: &DVector<f64>| u.dot(&whole.solve(u));
        let total: DVector<f64> = self.score.parts.iter().fold(DVector::zeros(whole.l().nrows()), |sum, u| sum + u);
        let by_part: Vec<f64> = self.score.parts.iter().map(&statistic).collect();
        let of_parts: f64 = by_part.iter().sum();
        let mut unexplained = DMatrix::zeros(total.len(), self.score.parts.len());
        for (i, own) in self.score.parts.iter().enumerate() {
            let others = &total - own;
            let agreement = statistic(&others) / (of_parts - by_part[i]).max(f64::MIN_POSITIVE);
            let shrunk = (1.0 - LEAST_AGREEMENT / agreement).max(0.0);
            let mut left = self.left_out[i].clone();
            if let Some(factor) = (shrunk > 0.0).then(|| self.without(i)).flatten() {
                left -= &self.information[i] * factor.solve(&others) * shrunk;
            }
            unexplained.set_column(i, &left);
        }
        // uᵀ (L Lᵀ)⁻¹ u = |L⁻¹ u|².
        let roots = whole.l().solve_lower_triangular(&(&unexplained * signs))?;
        let alone: f64 = unexplained.column_iter().map(|u| statistic(&u.into_owned())).sum();
        let by_chance = roots.column_iter().map(|root| root.norm_squared() - alone).collect();
        Some((statistic(&total) - of_parts, by_chance))
    }

    fn without(&self, part: usize) -> Option<Cholesky<f64, Dyn>> {
        (&self.score.information - &self.information[part] + self.prior).cholesky()
    }
}
