//! Effects that explain together: stepwise selection forwards and backwards on the linearised problem.
//!
//! An effect that resembles two others is the best one alone and needless once both are there. So after the search forwards
//! those are taken out again that the rest make needless (floating search: Pudil, Novovičová, Kittler 1994).

use super::decision::{difference, rank, significant};
use super::evidence::Examination;

/// Effects that explain together are sought up to this number.
const MOST_TOGETHER: usize = 3;
/// Further effects count when they add at least this share of what all explain.
const WORTH: f64 = 0.1;
/// Times forwards and backwards.
const ROUNDS: usize = 3;

/// Effects that explain together.
pub(super) struct Together {
    /// Their places in [`Examination::evidence`], by falling rank.
    pub members: Vec<usize>,
    /// Fall of every frame's cost when all were estimated without it.
    pub gains: Vec<f64>,
    /// Sum of their score statistics, each beside those before it.
    pub statistic: f64,
}

impl Together {
    /// Starts with `first` and takes further ones of `effects`; `first` itself may turn out to be needless.
    pub fn explain(examination: &Examination, effects: &[usize], first: usize) -> Self {
        let mut members = vec![first];
        for _ in 0..ROUNDS {
            let before = members.clone();
            grow(examination, effects, &mut members);
            if !shrink(examination, &mut members) || members == before {
                break;
            }
        }
        members.sort_by(|a, b| rank(examination, *b).total_cmp(&rank(examination, *a)));
        let statistic = (0..members.len()).map(|i| beside(examination, members[i], &members[..i]).0).sum();
        Self { gains: gains(examination, &members), members, statistic }
    }

    /// Sum of the gains.
    pub fn explained(&self) -> f64 {
        self.gains.iter().sum()
    }
}

/// Places in the linearisation.
fn columns(examination: &Examination, members: &[usize]) -> Vec<usize> {
    members.iter().map(|i| examination.evidence[*i].index).collect()
}

fn gains(examination: &Examination, members: &[usize]) -> Vec<f64> {
    examination.linearization.held_out_gain(&columns(examination, members))
}

/// Score statistic and p-value of a candidate beside others.
pub(super) fn beside(examination: &Examination, candidate: usize, others: &[usize]) -> (f64, f64) {
    let candidate = examination.evidence[candidate].index;
    let score = examination.linearization.score_adjusted(candidate, &columns(examination, others));
    (score.statistic, score.p_value)
}

/// What `candidate` adds to `members`, frame by frame, given their own gains.
pub(super) fn added(examination: &Examination, candidate: usize, members: &[usize], gains_of: &[f64]) -> Vec<f64> {
    let extended: Vec<usize> = members.iter().copied().chain(std::iter::once(candidate)).collect();
    difference(&gains(examination, &extended), gains_of)
}

/// Whether what a member adds to the `others` is worth it.
fn is_needed(examination: &Examination, member: usize, others: &[usize], added: &[f64], all: f64) -> bool {
    let p_value = beside(examination, member, others).1;
    added.iter().sum::<f64>() > WORTH * all && significant(p_value, examination.tests, added)
}

fn grow(examination: &Examination, effects: &[usize], members: &mut Vec<usize>) {
    while members.len() < MOST_TOGETHER {
        let present = gains(examination, members);
        let next = effects
            .iter()
            .copied()
            .filter(|i| !members.contains(i))
            .map(|i| (i, added(examination, i, members, &present)))
            .max_by(|a, b| a.1.iter().sum::<f64>().total_cmp(&b.1.iter().sum::<f64>()));
        let Some((next, added)) = next else { return };
        if !is_needed(examination, next, members, &added, present.iter().sum()) {
            return;
        }
        members.push(next);
    }
}

/// Takes out the most needless member as long as there is one. Returns whether there was.
fn shrink(examination: &Examination, members: &mut Vec<usize>) -> bool {
    let before = members.len();
    while members.len() > 1 {
        let all: f64 = gains(examination, members).iter().sum();
        let least = (0..members.len())
            .map(|i| {
                let others: Vec<usize> = members.iter().copied().filter(|m| *m != members[i]).collect();
                let own = added(examination, members[i], &others, &gains(examination, &others));
                (i, is_needed(examination, members[i], &others, &own, all), own.iter().sum::<f64>())
            })
            .min_by(|a, b| a.2.total_cmp(&b.2));
        match least {
            Some((i, false, _)) => members.remove(i),
            _ => break,
        };
    }
    members.len() < before
}
