//! The search of the additive model: all pairs of groups, exchanges, and the test of every member given all others.

use std::collections::BTreeSet;

use depthcal_statistics::normal_tail;
use rayon::prelude::*;
use tracing::debug;

use super::blocks::{Blocks, block_of, blocks_of};
use super::model::Additive;
use super::normal::{LeftOutParts, Normal};
use super::penalty::block_diagonal;

/// Most functions of a model.
pub(super) const MOST: usize = 4;
/// Passes of exchanges.
const PASSES: usize = 2;
/// Least fall of the cost ½ Σ r² of left-out clusters by a function given all others, and the same per row …
const LEAST_GAIN: f64 = 15.0;
const LEAST_GAIN_PER_ROW: f64 = 0.002;
/// … and the level of Wilcoxon's test over clusters, and the least share of these that it makes better: the gain of single ones
/// may be large by chance, but not that of most.
const LEVEL: f64 = 0.01;
const LEAST_SHARE: f64 = 0.6;
/// The search starts from this many pairs of groups, those that gain most, and once from the best single group.
const STARTS: usize = 3;
/// Groups of one spline, and of two, whose gain is compared on left-out clusters as a further member: those that explain most of
/// the other clusters.
const PROMISING: usize = 12;
/// Share of its gain that a function of two covariates may lose to one of a single covariate, or to one of fewer parameters.
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
    blocks: Blocks<'a>,
    rows: usize,
}

/// The functions that the residuals depend on, each certain given all others: most of the clusters, left out in blocks, become
/// better with it. Empty where there are none, or fewer than three blocks of clusters.
pub fn search(model: &Additive<'_>) -> Vec<Found> {
    let certain = grown(model).into_iter().map(|members| certain(model, &members));
    certain.max_by(|a, b| a.1.total_cmp(&b.1)).map_or_else(Vec::new, |(functions, _)| functions)
}

/// Sets of groups that together lower the cost of left-out clusters most. Their members need not be certain: which of them are
/// is to be asked once functions that are close to them have been compared too ([`certain`]).
pub fn grown(model: &Additive<'_>) -> Vec<Vec<usize>> {
    let Some(blocks) = Blocks::of(model) else { return Vec::new() };
    let mut search = Search { model, blocks, rows: model.rows() };
    let usual = search.blocks.penalties.clone();
    let mut sets: Vec<Vec<usize>> = Vec::new();
    for start in search.starts() {
        search.blocks.penalties.clone_from(&usual);
        let grown = search.grown(start);
        if !sets.contains(&grown) {
            sets.push(grown);
        }
    }
    sets
}

/// The functions of some groups, exchanged for others of the model where that gains, that are certain given all others, and the
/// fall of the cost ½ Σ r² of left-out clusters with them.
pub fn certain(model: &Additive<'_>, members: &[usize]) -> (Vec<Found>, f64) {
    let Some(blocks) = Blocks::of(model) else { return (Vec::new(), 0.0) };
    let mut search = Search { model, blocks, rows: model.rows() };
    let mut functions: Vec<Found> = Vec::new();
    for group in search.certain(members.to_vec()) {
        let covariates = &model.groups[group].covariates;
        match functions.iter_mut().find(|other| other.covariates == *covariates) {
            Some(other) => other.groups.push(group),
            None => functions.push(Found { covariates: covariates.clone(), groups: vec![group], share: 0.0 }),
        }
    }
    let gain_without = |place: Option<usize>| {
        let others = functions.iter().enumerate().filter(|(other, _)| Some(*other) != place);
        search.blocks.gain(&others.flat_map(|(_, function)| function.groups.clone()).collect::<Vec<_>>())
    };
    let (cost, whole) = (model.cost(), gain_without(None));
    let shares: Vec<f64> = (0..functions.len()).map(|place| (whole - gain_without(Some(place))) / cost).collect();
    functions.iter_mut().zip(shares).for_each(|(function, share)| function.share = share);
    (functions, whole)
}

impl Search<'_> {
    /// The pairs of groups that gain most, and the best single group.
    fn starts(&self) -> Vec<Vec<usize>> {
        let tested = &self.blocks.tested;
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
        pairs.truncate(STARTS);
        let single = self.additions(&[]).into_iter().take(1).map(|(group, gain)| (vec![group], gain));
        let starts = pairs.into_iter().chain(single).filter(|(_, gain)| *gain > least_gain(self.rows));
        starts
            .inspect(|(start, gain)| debug!("additive: {} gains {gain:.1}", self.model.words(start)))
            .map(|s| s.0)
            .collect()
    }

    /// The members with others that gain most, each exchanged against all groups.
    fn grown(&mut self, mut members: Vec<usize>) -> Vec<usize> {
        loop {
            members = self.exchanged(members);
            // What a member is too stiff for would be taken for another function.
            self.blocks.choose_strengths(&members);
            let gain = self.blocks.gain(&members);
            match self.additions(&members).first() {
                Some((group, with)) if members.len() < MOST && *with > gain + least_gain(self.rows) => {
                    members.push(*group)
                }
                _ => {
                    members.sort_unstable();
                    return members;
                }
            }
        }
    }

    /// The members, exchanged, that are certain given all others.
    fn certain(&mut self, mut members: Vec<usize>) -> Vec<usize> {
        for _ in 0..PASSES {
            members = self.exchanged(members);
            self.blocks.choose_strengths(&members);
        }
        while let Some(place) = self.least_certain(&members) {
            members.remove(place);
            self.blocks.choose_strengths(&members);
        }
        self.simplified(members)
    }

    /// The members, with each function of two covariates replaced by others that explain as much with less: of single
    /// covariates, or of fewer parameters.
    fn simplified(&self, mut members: Vec<usize>) -> Vec<usize> {
        for member in members.clone() {
            let others: Vec<usize> = members.iter().copied().filter(|other| *other != member).collect();
            let [whole, without] = [&members, &others].map(|groups| self.blocks.gain(groups));
            let simpler: Vec<(Vec<usize>, f64)> = self
                .simpler(member, &others)
                .into_par_iter()
                .map(|groups| {
                    let gain = self.blocks.gain(&[&others[..], &groups].concat());
                    (groups, gain)
                })
                .collect();
            let enough = simpler.into_iter().filter(|(_, gain)| whole - gain <= SIMPLER * (whole - without));
            let size = |groups: &[usize]| {
                let covariates = groups.iter().map(|group| self.model.groups[*group].covariates.len());
                let columns: usize = groups.iter().map(|group| self.model.groups[*group].count()).sum();
                (covariates.max(), columns)
            };
            if let Some((groups, _)) = enough.min_by(|a, b| size(&a.0).cmp(&size(&b.0)).then(b.1.total_cmp(&a.1))) {
                members = [others, groups].concat();
            }
        }
        members
    }

    /// Groups of the covariates of a member of two with less: one of these, both singly, or both together with fewer columns.
    fn simpler(&self, member: usize, others: &[usize]) -> Vec<Vec<usize>> {
        let of_member = &self.model.groups[member];
        if of_member.covariates.len() < 2 {
            return Vec::new();
        }
        let is_free = |group: &usize| *group != member && !others.contains(group);
        let free: Vec<usize> = self.blocks.tested.iter().copied().filter(is_free).collect();
        let groups_of = |covariates: &BTreeSet<usize>| -> Vec<usize> {
            free.iter().copied().filter(|group| self.model.groups[*group].covariates == *covariates).collect()
        };
        let singly: Vec<Vec<usize>> = of_member.covariates.iter().map(|c| groups_of(&BTreeSet::from([*c]))).collect();
        let both = singly[0].iter().flat_map(|a| singly[1].iter().map(|b| vec![*a, *b]));
        let smaller =
            groups_of(&of_member.covariates).into_iter().filter(|g| self.model.groups[*g].count() < of_member.count());
        singly.iter().flatten().copied().chain(smaller).map(|group| vec![group]).chain(both).collect()
    }

    /// The groups with which the model of some members gains most, the best first.
    fn additions(&self, members: &[usize]) -> Vec<(usize, f64)> {
        let gain = |group: usize| (group, self.blocks.gain(&[members, &[group]].concat()));
        let is_double = |group: &usize| self.model.groups[*group].axes.len() > 1;
        let (of_two, of_one): (Vec<usize>, Vec<usize>) =
            self.blocks.most_promising(members).into_iter().partition(is_double);
        let promising: Vec<usize> = [of_one, of_two].iter().flat_map(|g| g.iter().take(PROMISING).copied()).collect();
        let mut additions: Vec<(usize, f64)> = promising.into_par_iter().map(gain).collect();
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

    /// The place of the member that most likely is chance given all others, of those that are not certain.
    fn least_certain(&self, members: &[usize]) -> Option<usize> {
        let whole = self.gains(members);
        let uncertain = members.iter().enumerate().filter_map(|(place, member)| {
            let others: Vec<usize> = members.iter().copied().filter(|other| other != member).collect();
            let without = self.gains(&others);
            let [in_blocks, interleaved] = [0, 1].map(|how| -> Vec<f64> {
                whole[how].iter().zip(&without[how]).map(|(with, without)| with - without).collect()
            });
            // A block of consecutive clusters is an extrapolation of a function of time: there it must not lose.
            let gains = if self.is_sequential(*member) { &interleaved } else { &in_blocks };
            let is_certain = is_certain(gains, least_gain(self.rows)) && in_blocks.iter().sum::<f64>() > 0.0;
            let p_value = signed_rank_p_value(gains);
            debug!(
                "additive: {} given {}: gain {:.1}, p {p_value:.2e}, {:.2} of clusters, certain: {is_certain}",
                self.model.words(&[*member]),
                self.model.words(&others),
                gains.iter().sum::<f64>(),
                share_above_zero(gains)
            );
            (!is_certain).then_some((place, p_value))
        });
        uncertain.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(place, _)| place)
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
            LeftOutParts::new(normals.clone(), self.model.shared(), parts).gains(&penalty)
        };
        [gains(&|cluster| block_of(cluster, count)), gains(&|cluster| cluster % blocks_of(count))]
    }
}

/// Least fall of the cost of left-out clusters, which have so many rows, by a function given all others.
pub(super) fn least_gain(rows: usize) -> f64 {
    LEAST_GAIN.max(LEAST_GAIN_PER_ROW * rows as f64)
}

/// Whether gains of clusters are more than chance, and more than next to nothing.
fn is_certain(gains: &[f64], least: f64) -> bool {
    gains.iter().sum::<f64>() >= least && signed_rank_p_value(gains) < LEVEL && share_above_zero(gains) >= LEAST_SHARE
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
