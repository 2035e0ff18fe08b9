//! The search of the additive model: all pairs of groups, exchanges, and the test of every member given all others.

use std::collections::BTreeSet;

use depthcal_formula::FormulaCovariate as C;
use depthcal_statistics::normal_tail;
use rayon::prelude::*;
use tracing::debug;

use super::super::observations::{Normal, Observations};
use super::super::score::left_out_gains;
use super::blocks::{Blocks, block_of, blocks_of};
use super::dictionary::Dictionary;
use super::penalty::block_diagonal;

/// Most functions of a model.
const MOST: usize = 5;
/// Passes of exchanges.
const PASSES: usize = 3;
/// Least fall of the cost ½ Σ r² of left-out frames by a function given all others, and the same per sample …
const LEAST_GAIN: f64 = 15.0;
const LEAST_GAIN_PER_SAMPLE: f64 = 0.002;
/// … and the level of Wilcoxon's test over frames, and the least share of frames that it makes better: the gain of single frames
/// may be large by chance, but not that of most.
const LEVEL: f64 = 0.01;
const LEAST_SHARE: f64 = 0.6;
/// Pairs, single groups and additions that are tried, the best first, until all members are certain.
const STARTS: usize = 4;
/// Share by which the gain of a pair has to exceed that of the best single group.
const WORTH: f64 = 0.02;

/// Share of its gain that a function of two covariates may lose to one of a single covariate.
const SIMPLER: f64 = 0.05;

/// A function of some covariates: the groups that describe it.
#[derive(Debug, Clone)]
pub(super) struct Found {
    pub covariates: BTreeSet<C>,
    /// Numbers of its groups.
    pub groups: Vec<usize>,
}

/// The model of a search.
struct Search<'a> {
    observations: &'a Observations,
    dictionary: &'a Dictionary,
    blocks: &'a Blocks,
    samples: usize,
}

/// The functions that the residuals depend on, each certain given all others.
pub(super) fn components(observations: &Observations, dictionary: &Dictionary, blocks: &Blocks) -> Vec<Found> {
    let samples = observations.samples().count();
    let search = Search { observations, dictionary, blocks, samples };
    let mut functions: Vec<Found> = Vec::new();
    for group in search.members() {
        let covariates = dictionary.covariates(&dictionary.groups[group]);
        match functions.iter_mut().find(|other| other.covariates == covariates) {
            Some(other) => other.groups.push(group),
            None => functions.push(Found { covariates, groups: vec![group] }),
        }
    }
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
        let covariates = |group: usize| self.dictionary.covariates(&self.dictionary.groups[group]);
        for place in 0..members.len() {
            let of_member = covariates(members[place]);
            if of_member.len() < 2 {
                continue;
            }
            let mut others = members.clone();
            others.remove(place);
            let [whole, without] = [&members, &others].map(|groups| self.blocks.gain(self.dictionary, groups));
            let simpler = self.blocks.tested.par_iter().copied().filter(|group| {
                let of_group = covariates(*group);
                of_group.len() == 1 && of_group.is_subset(&of_member) && !others.contains(group)
            });
            let gain = |group: usize| (group, self.blocks.gain(self.dictionary, &[&others[..], &[group]].concat()));
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
                let gain = self.blocks.gain(self.dictionary, &pair);
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
        let gain = |group: usize| (group, self.blocks.gain(self.dictionary, &[members, &[group]].concat()));
        let others = self.blocks.tested.par_iter().copied().filter(|group| !members.contains(group));
        let mut additions: Vec<(usize, f64)> = others.map(gain).collect();
        additions.sort_by(|a, b| b.1.total_cmp(&a.1));
        additions
    }

    /// The members, each exchanged against all other groups as long as that gains.
    fn exchanged(&self, mut members: Vec<usize>) -> Vec<usize> {
        let mut gain = self.blocks.gain(self.dictionary, &members);
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
        let whole = self.frame_gains(members);
        members.iter().all(|member| {
            let others: Vec<usize> = members.iter().copied().filter(|other| other != member).collect();
            let without = self.frame_gains(&others);
            let [in_blocks, interleaved] = [0, 1].map(|how| -> Vec<f64> {
                whole[how].iter().zip(&without[how]).map(|(with, without)| with - without).collect()
            });
            // A block of consecutive frames is an extrapolation of a function of time: there it must not lose.
            let is_of_time = self.is_of_time(*member);
            let gains = if is_of_time { &interleaved } else { &in_blocks };
            let is_certain = is_certain(gains, self.samples) && in_blocks.iter().sum::<f64>() > 0.0;
            debug!(
                "additive: {} given {}: gain {:.1}, p {:.2e}, {:.2} of frames, certain: {is_certain}",
                self.words(&[*member]),
                self.words(&others),
                gains.iter().sum::<f64>(),
                signed_rank_p_value(gains),
                share_above_zero(gains)
            );
            is_certain
        })
    }

    /// Whether a function depends on what changes with the frames alone: consecutive ones may have values of their own.
    fn is_of_time(&self, group: usize) -> bool {
        let covariates = self.dictionary.covariates(&self.dictionary.groups[group]);
        covariates.iter().any(|c| matches!(c, C::Time | C::Temperature | C::Quantity(_)))
    }

    /// Fall of the cost of every frame with some groups that are estimated without its block of consecutive frames, and without
    /// as many frames from all over the capture.
    fn frame_gains(&self, groups: &[usize]) -> [Vec<f64>; 2] {
        let normals: Vec<Normal> = self.observations.normals_of(|frame| self.dictionary.columns(frame, groups));
        let count = normals.len();
        if groups.is_empty() {
            return [vec![0.0; count], vec![0.0; count]];
        }
        let penalty = block_diagonal(groups.iter().map(|g| &self.blocks.penalties[*g]));
        let gains = |part: &dyn Fn(usize) -> usize| {
            let parts: Vec<usize> = (0..count).map(part).collect();
            left_out_gains(&normals, self.observations.shared, &penalty, &parts, blocks_of(count))
        };
        [gains(&|frame| block_of(frame, count)), gains(&|frame| frame % blocks_of(count))]
    }

    fn words(&self, groups: &[usize]) -> String {
        let word = |group: &usize| {
            let group = &self.dictionary.groups[*group];
            let covariates = self.dictionary.covariates(group);
            let pair = || covariates.iter().map(|c| c.name()).collect::<Vec<_>>().join(", ");
            let single = group.smooth.map_or("1", |i| self.dictionary.smooth[i].covariate.name());
            let smooth = if group.pair.is_some() { pair() } else { single.to_owned() };
            let factor = group.factor.map_or(String::new(), |f| format!("·{}", self.dictionary.factors[f].0.name()));
            format!("s({smooth}){factor} {} {}", group.of.name(), group.on.name())
        };
        groups.iter().map(word).collect::<Vec<_>>().join(" + ")
    }
}

/// Whether gains of frames, from so many samples, are more than chance and more than next to nothing.
fn is_certain(gains: &[f64], samples: usize) -> bool {
    gains.iter().sum::<f64>() >= LEAST_GAIN.max(LEAST_GAIN_PER_SAMPLE * samples as f64)
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
