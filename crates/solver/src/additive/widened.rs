//! Groups that are too many and too wide for products of all of them with each other.

use nalgebra::DMatrix;
use rayon::prelude::*;
use tracing::debug;

use super::candidate_products::CandidateProducts;
use super::model::Additive;
use super::search::{MOST, least_gain};

/// Candidates that are tried in place of a member: those that gain most when they join all members.
const PROMISING: usize = 8;
/// Share of the gain of the members by which a change has to raise it: the best of many wide functions gains by chance.
const LEAST_RISE: f64 = 0.1;
/// Changes of the members.
const CHANGES: usize = 4;

/// Sets of members of a model, each changed as long as left-out clusters cost less: joined by one of `candidates`, or with one
/// replaced by it. A candidate is compared with the members alone, not with other candidates.
pub fn widened(model: &Additive<'_>, sets: &[Vec<usize>], candidates: &[usize]) -> Vec<Vec<usize>> {
    let mut sets = sets.to_vec();
    let mut changing: Vec<usize> = (0..sets.len()).collect();
    for _ in 0..CHANGES {
        if changing.is_empty() {
            break;
        }
        let mut groups: Vec<usize> = changing.iter().flat_map(|set| sets[*set].iter().copied()).collect();
        groups.sort_unstable();
        groups.dedup();
        let Some(products) = CandidateProducts::of(model, &groups, candidates) else { break };
        changing.retain(|set| match changed(model, &products, &sets[*set], candidates) {
            Some(better) => {
                sets[*set] = better;
                true
            }
            None => false,
        });
    }
    sets
}

/// The members with the change that gains most.
fn changed(
    model: &Additive<'_>,
    products: &CandidateProducts<'_>,
    members: &[usize],
    candidates: &[usize],
) -> Option<Vec<usize>> {
    let (gain, penalties) = of_members(products, members)?;
    let least = gain + least_gain(model.rows()).max(LEAST_RISE * gain);
    let all: Vec<usize> = (0..=members.len()).collect();
    let joined = |candidate: &usize| {
        let mut blocks = products.blocks(members, Some(*candidate))?;
        blocks.penalties[..members.len()].clone_from_slice(&penalties);
        let gain = blocks.gain(&all);
        Some((blocks, gain))
    };
    let gain_joined_by = |candidate: &usize| Some((*candidate, joined(candidate)?.1));
    let others: Vec<usize> = candidates.iter().copied().filter(|c| !members.contains(c)).collect();
    let mut promising: Vec<(usize, f64)> = others.par_iter().filter_map(gain_joined_by).collect();
    promising.sort_by(|a, b| b.1.total_cmp(&a.1));
    promising.truncate(PROMISING);
    let changes = |(candidate, _): (usize, f64)| {
        // Made again: the blocks of all candidates would take much memory.
        let (blocks, gain_joined) = joined(&candidate)?;
        let with = [members, &[candidate]].concat();
        let without = |place: usize| {
            let left: Vec<usize> = all.iter().copied().filter(|other| *other != place).collect();
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
    let compared: Vec<(Vec<usize>, f64)> = promising.into_par_iter().filter_map(changes).collect();
    let best = compared.into_iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    debug!("additive: {} gains {gain:.1}, {} {:.1}", model.words(members), model.words(&best.0), best.1);
    (best.1 > least).then_some(best.0)
}

/// The fall of the cost of left-out clusters with some groups, and the penalties with which it is largest.
fn of_members(products: &CandidateProducts<'_>, members: &[usize]) -> Option<(f64, Vec<DMatrix<f64>>)> {
    if members.is_empty() {
        return Some((0.0, Vec::new()));
    }
    let mut blocks = products.blocks(members, None)?;
    let places: Vec<usize> = (0..members.len()).collect();
    blocks.choose_strengths(&places);
    Some((blocks.gain(&places), blocks.penalties))
}
