//! The search of the additive model: all pairs of groups, exchanges, and the test of every member given all others.

use std::collections::BTreeSet;

use depthcal_statistics::normal_tail;
use rayon::prelude::*;
use tracing::debug;

use super::blocks::{Blocks, block_of, blocks_of};
use super::model::Additive;
use super::normal::{Normal, left_out_gains};
use super::penalty::block_diagonal;

/// Most functions of a model.
const MOST: usize = 5;
/// Passes of exchanges.
const PASSES: usize = 3;
/// Least fall of the cost ½ Σ r² of left-out clusters by a function given all others, and the same per row …
const LEAST_GAIN: f64 = 15.0;
const LEAST_GAIN_PER_ROW: f64 = 0.002;
/// … and the level of Wilcoxon's test over clusters, and the least share of these that it makes better: the gain of single ones
/// may be large by chance, but not that of most.
const LEVEL: f64 = 0.01;
const LEAST_SHARE: f64 = 0.6;
/// Pairs, single groups and additions that are tried, the best first, until all members are certain.
const STARTS: usize = 4;
/// Share by which the gain of a pair has to exceed that of the best single group.
const WORTH: f64 = 0.02;

/// Share of its gain that a function of two covariates may lose to one of a single covariate.
const SIMPLER: f64 = 0.05;

/// A function that the residuals depend on, given all others.
#[derive(Debug, Clone)]
pub struct Found {
    /// Quantities that it depends on.
    pub covariates: BTreeSet<usize>,
    /// Numbers of the groups that describe it.
    pub groups: Vec<usize>,
    /// Share of the squared residuals of left-out clusters that it explains, given all others.
    pub share: f64,
}

/// The model of a search.
struct Search<'a> {
    model: &'a Additive<'a>,
    blocks: &'a Blocks,
    rows: usize,
}

/// The functions that the residuals depend on, each certain given all others: most of the clusters, left out in blocks, become
/// better with it. Empty where there are none, or fewer than three blocks of clusters.
pub fn search(model: &Additive<'_>) -> Vec<Found> {
    let Some(blocks) = Blocks::of(model) else { return Vec::new() };
    let search = Search { model, blocks: &blocks, rows: model.rows() };
    let mut functions: Vec<Found> = Vec::new();
    for group in search.members() {
        let covariates = &model.groups[group].covariates;
        match functions.iter_mut().find(|other| other.covariates == *covariates) {
            Some(other) => other.groups.push(group),
            None => functions.push(Found { covariates: covariates.clone(), groups: vec![group], share: 0.0 }),
        }
    }
    let gain_without = |place: Option<usize>| {
        let others = functions.iter().enumerate().filter(|(other, _)| Some(*other) != place);
        blocks.gain(&others.flat_map(|(_, function)| function.groups.clone()).collect::<Vec<_>>())
    };
    let (cost, whole) = (model.cost(), gain_without(None));
    let shares: Vec<f64> = (0..functions.len()).map(|place| (whole - gain_without(Some(place))) / cost).collect();
    functions.iter_mut().zip(shares).for_each(|(function, share)| function.share = share);
    functions
}

impl Search<'_> {
    fn members(&self) -> Vec<usize> {
        let mut members = self.start();
        while !members.is_empty() && members.len() < MOST {
            let mut tried = BTreeSet::new();
            let extended = self.additions(&members).into_iter().take(STARTS).find_map(|(group, _)| {
                let mut extended = self.exchanged([&members[..], &[group]].concat());
                extended.sort_unstable();
                (tried.insert(extended.clone()) && self.are_certain(&extended)).then_some(extended)
            });
            let Some(extended) = extended else { break };
            members = extended;
        }
        self.simplified(members)
    }

    /// The members, with those of two covariates replaced by the best of one of these that explains as much.
    fn simplified(&self, mut members: Vec<usize>) -> Vec<usize> {
        let covariates = |group: usize| &self.model.groups[group].covariates;
        for place in 0..members.len() {
            let of_member = covariates(members[place]);
            if of_member.len() < 2 {
                continue;
            }
            let mut others = members.clone();
            others.remove(place);
            let [whole, without] = [&members, &others].map(|groups| self.blocks.gain(groups));
            let simpler = self.blocks.tested.par_iter().copied().filter(|group| {
                let of_group = covariates(*group);
                of_group.len() == 1 && of_group.is_subset(of_member) && !others.contains(group)
            });
            let gain = |group: usize| (group, self.blocks.gain(&[&others[..], &[group]].concat()));
            if let Some((group, gain)) = simpler.map(gain).max_by(|a, b| a.1.total_cmp(&b.1))
                && whole - gain <= SIMPLER * (whole - without)
            {
                members[place] = group;
            }
        }
        members
    }

    /// The best pair of which both are certain given the other, else the best single group that is certain; empty where none is.
    fn start(&self) -> Vec<usize> {
        let tested = &self.blocks.tested;
        let singles: Vec<(Vec<usize>, f64)> =
            self.additions(&[]).into_iter().map(|(group, gain)| (vec![group], gain)).collect();
        let with = |place: usize| {
            let gain = |second: &usize| {
                let pair = vec![tested[place], *second];
                let gain = self.blocks.gain(&pair);
                (pair, gain)
            };
            tested[place + 1..].iter().map(gain).max_by(|a, b| a.1.total_cmp(&b.1))
        };
        let mut pairs: Vec<(Vec<usize>, f64)> = (0..tested.len()).into_par_iter().filter_map(with).collect();
        pairs.sort_by(|a, b| b.1.total_cmp(&a.1));
        let of_single = singles.first().map_or(0.0, |(_, gain)| gain.max(0.0));
        pairs.retain(|(_, gain)| *gain > (1.0 + WORTH) * of_single);
        for (start, gain) in [&pairs, &singles].into_iter().flat_map(|starts| starts.iter().take(STARTS)) {
            debug!("additive: {} gains {gain:.1}", self.words(start));
        }
        let mut tried = BTreeSet::new();
        let mut certain = |start: &[usize]| {
            let mut members = if start.len() > 1 { self.exchanged(start.to_vec()) } else { start.to_vec() };
            members.sort_unstable();
            (tried.insert(members.clone()) && self.are_certain(&members)).then_some(members)
        };
        let mut starts = pairs.iter().take(STARTS).chain(singles.iter().take(STARTS));
        starts.find_map(|(start, _)| certain(start)).unwrap_or_default()
    }

    /// The groups with which the model of some members gains most, the best first.
    fn additions(&self, members: &[usize]) -> Vec<(usize, f64)> {
        let gain = |group: usize| (group, self.blocks.gain(&[members, &[group]].concat()));
        let others = self.blocks.tested.par_iter().copied().filter(|group| !members.contains(group));
        let mut additions: Vec<(usize, f64)> = others.map(gain).collect();
        additions.sort_by(|a, b| b.1.total_cmp(&a.1));
        additions
    }

    /// The members, each exchanged against all other groups as long as that gains.
    fn exchanged(&self, mut members: Vec<usize>) -> Vec<usize> {
        let mut gain = self.blocks.gain(&members);
        for _ in 0..PASSES {
            let before = members.clone();
            for place in 0..members.len() {
                let mut others = members.clone();
                others.remove(place);
                if let Some(&(group, other)) = self.additions(&others).first()
                    && other > gain
                {
                    (members[place], gain) = (group, other);
                }
            }
            if members == before {
                break;
            }
        }
        members
    }

    /// Whether every member is certain given all others.
    fn are_certain(&self, members: &[usize]) -> bool {
        let whole = self.gains(members);
        members.iter().all(|member| {
            let others: Vec<usize> = members.iter().copied().filter(|other| other != member).collect();
            let without = self.gains(&others);
            let [in_blocks, interleaved] = [0, 1].map(|how| -> Vec<f64> {
                whole[how].iter().zip(&without[how]).map(|(with, without)| with - without).collect()
            });
            // A block of consecutive clusters is an extrapolation of a function of time: there it must not lose.
            let gains = if self.is_sequential(*member) { &interleaved } else { &in_blocks };
            let is_certain = is_certain(gains, self.rows) && in_blocks.iter().sum::<f64>() > 0.0;
            debug!(
                "additive: {} given {}: gain {:.1}, p {:.2e}, {:.2} of clusters, certain: {is_certain}",
                self.words(&[*member]),
                self.words(&others),
                gains.iter().sum::<f64>(),
                signed_rank_p_value(gains),
                share_above_zero(gains)
            );
            is_certain
        })
    }

    fn is_sequential(&self, group: usize) -> bool {
        !self.model.groups[group].covariates.is_disjoint(&self.model.sequential)
    }

    /// Fall of the cost of every cluster with some groups that are estimated without its block of consecutive ones, and without
    /// as many from everywhere.
    fn gains(&self, groups: &[usize]) -> [Vec<f64>; 2] {
        let normals: Vec<Normal> = self.model.normals(groups);
        let count = normals.len();
        if groups.is_empty() {
            return [vec![0.0; count], vec![0.0; count]];
        }
        let penalty = block_diagonal(groups.iter().map(|g| &self.blocks.penalties[*g]));
        let gains = |part: &dyn Fn(usize) -> usize| {
            let parts: Vec<usize> = (0..count).map(part).collect();
            left_out_gains(&normals, self.model.shared(), &penalty, &parts, blocks_of(count))
        };
        [gains(&|cluster| block_of(cluster, count)), gains(&|cluster| cluster % blocks_of(count))]
    }

    fn words(&self, groups: &[usize]) -> String {
        groups.iter().map(|group| self.model.groups[*group].words.as_str()).collect::<Vec<_>>().join(" + ")
    }
}

/// Whether gains of clusters, from so many rows, are more than chance and more than next to nothing.
fn is_certain(gains: &[f64], rows: usize) -> bool {
    gains.iter().sum::<f64>() >= LEAST_GAIN.max(LEAST_GAIN_PER_ROW * rows as f64)
        && signed_rank_p_value(gains) < LEVEL
        && share_above_zero(gains) >= LEAST_SHARE
}

fn share_above_zero(gains: &[f64]) -> f64 {
    gains.iter().filter(|gain| **gain > 0.0).count() as f64 / gains.len().max(1) as f64
}

/// Probability that the sum of the ranks of positive gains is as large by chance, by its normal distribution (Wilcoxon 1945).
fn signed_rank_p_value(gains: &[f64]) -> f64 {
    let mut gains: Vec<f64> = gains.iter().copied().filter(|gain| *gain != 0.0).collect();
    gains.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    let n = gains.len() as f64;
    let sum: f64 = (1..).map(f64::from).zip(&gains).map(|(rank, gain)| rank * gain.signum()).sum();
    let deviation = (n * (n + 1.0) * (2.0 * n + 1.0) / 6.0).sqrt();
    if deviation > 0.0 { normal_tail(sum / deviation) } else { 1.0 }
}
