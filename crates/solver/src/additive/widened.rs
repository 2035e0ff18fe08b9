//! Groups that are too many and too wide for products of all of them with each other.

use nalgebra::DMatrix;
use rayon::prelude::*;
use tracing::debug;

use super::blocks::Blocks;
use super::model::Additive;
use super::search::{MOST, least_gain};

/// Candidates that are tried in place of a member: those that gain most when they join all members.
const PROMISING: usize = 8;
/// Share of the gain of the members by which a change has to raise it: the best of many wide functions gains by chance.
const LEAST_RISE: f64 = 0.1;
/// Changes of the members.
const CHANGES: usize = 4;

/// The members of a model, changed as long as left-out clusters cost less: joined by one of `candidates`, or with one replaced by
/// it. A candidate is compared with the members alone, not with other candidates.
pub fn widened(model: &Additive<'_>, members: &[usize], candidates: &[usize]) -> Vec<usize> {
    let mut members = members.to_vec();
    for _ in 0..CHANGES {
        match changed(model, &members, candidates) {
            Some(better) => members = better,
            None => break,
        }
    }
    members
}

/// The members with the change that gains most.
fn changed(model: &Additive<'_>, members: &[usize], candidates: &[usize]) -> Option<Vec<usize>> {
    let (gain, penalties) = of_members(model, members)?;
    let least = gain + least_gain(model.rows()).max(LEAST_RISE * gain);
    let joined = |candidate: &usize| {
        let with = [members, &[*candidate]].concat();
        let mut blocks = Blocks::of(&model.with_groups(&with))?;
        blocks.penalties[..members.len()].clone_from_slice(&penalties);
        let gain = blocks.gain(&(0..with.len()).collect::<Vec<_>>());
        Some((blocks, with, gain))
    };
    let others: Vec<usize> = candidates.iter().copied().filter(|c| !members.contains(c)).collect();
    let gain_beside = |candidate: &usize| joined(candidate).map(|(_, _, gain)| (*candidate, gain));
    let mut beside: Vec<(usize, f64)> = others.par_iter().filter_map(gain_beside).collect();
    beside.sort_by(|a, b| b.1.total_cmp(&a.1));
    beside.truncate(PROMISING);
    let changes = |candidate: &usize| {
        // Computed again: the products of all candidates would take much memory.
        let (blocks, with, gain_joined) = joined(candidate)?;
        let without = |place: usize| {
            let left: Vec<usize> = (0..with.len()).filter(|other| *other != place).collect();
            (left.iter().map(|other| with[*other]).collect::<Vec<_>>(), blocks.gain(&left))
        };
        let replaced = (0..members.len()).map(without).max_by(|a, b| a.1.total_cmp(&b.1));
        // A member that the candidate makes needless goes.
        let may_join = members.len() < MOST && gain_joined > least;
        match replaced {
            Some((set, of_set)) if !may_join || of_set > gain_joined - (least - gain) => Some((set, of_set)),
            _ if may_join => Some((with, gain_joined)),
            _ => None,
        }
    };
    let promising: Vec<usize> = beside.into_iter().map(|(candidate, _)| candidate).collect();
    let compared: Vec<(Vec<usize>, f64)> = promising.par_iter().filter_map(changes).collect();
    let best = compared.into_iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    debug!("additive: {} gains {gain:.1}, {} {:.1}", model.words(members), model.words(&best.0), best.1);
    (best.1 > least).then_some(best.0)
}

/// The fall of the cost of left-out clusters with some groups, and the penalties with which it is largest.
fn of_members(model: &Additive<'_>, members: &[usize]) -> Option<(f64, Vec<DMatrix<f64>>)> {
    if members.is_empty() {
        return Some((0.0, Vec::new()));
    }
    let alone = model.with_groups(members);
    let mut blocks = Blocks::of(&alone)?;
    let places: Vec<usize> = (0..members.len()).collect();
    blocks.choose_strengths(&places, &alone);
    Some((blocks.gain(&places), blocks.penalties))
}
