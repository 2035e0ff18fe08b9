//! Selection of effects that explain the residuals together: stepwise, forwards and backwards, on the linearised problem.
//!
//! An effect that resembles two others may be the best single one, and unnecessary once both are selected. So effects that the
//! others make unnecessary are removed after each search forwards (floating search: Pudil, Novovičová, Kittler 1994).

use super::evidence::difference;
use super::examination::Examination;
use super::merit::{penalized_merit, significant};
use super::thresholds::Thresholds;

/// Effects that explain the residuals together.
pub(super) struct SelectedEffects {
    /// Their places in [`Examination::evidence`], by falling penalised merit.
    pub members: Vec<usize>,
    /// Joint gain of every frame.
    pub gains: Vec<f64>,
    /// Sum of their score statistics, each given those before it.
    pub statistic: f64,
}

impl SelectedEffects {
    /// Starts with `first` and selects from `effects`, all places in [`Examination::evidence`]; `first` itself may be removed
    /// again.
    pub fn stepwise(examination: &Examination, effects: &[usize], first: usize, thresholds: &Thresholds) -> Self {
        let mut members = vec![first];
        for _ in 0..thresholds.most_selection_passes {
            let before = members.clone();
            select_forwards(examination, effects, &mut members, thresholds);
            if !remove_backwards(examination, &mut members, thresholds) || members == before {
                break;
            }
        }
        members.sort_by(|a, b| penalized_merit(examination, *b).total_cmp(&penalized_merit(examination, *a)));
        let statistic = (0..members.len()).map(|i| score_given(examination, members[i], &members[..i]).0).sum();
        Self { gains: joint_gains(examination, &members), members, statistic }
    }

    /// Sum of the joint gains.
    pub fn gain(&self) -> f64 {
        self.gains.iter().sum()
    }
}

/// Numbers of candidates in the linearisation.
fn indices(examination: &Examination, members: &[usize]) -> Vec<usize> {
    members.iter().map(|i| examination.evidence[*i].index).collect()
}

/// Gain of every frame with all members released.
fn joint_gains(examination: &Examination, members: &[usize]) -> Vec<f64> {
    examination.linearization.held_out_gain(&indices(examination, members))
}

/// Score statistic and p-value of a candidate, given that others are released.
pub(super) fn score_given(examination: &Examination, candidate: usize, others: &[usize]) -> (f64, f64) {
    let candidate = examination.evidence[candidate].index;
    let score = examination.linearization.score_adjusted(candidate, &indices(examination, others));
    (score.statistic, score.p_value)
}

/// Gain of every frame that `candidate` adds to the joint gains `present` of `members`.
pub(super) fn added_gains(examination: &Examination, candidate: usize, members: &[usize], present: &[f64]) -> Vec<f64> {
    let extended: Vec<usize> = members.iter().copied().chain(std::iter::once(candidate)).collect();
    difference(&joint_gains(examination, &extended), present)
}

/// Whether a member with the gains `added` over the `others` is needed: significant, and with a sufficient share of the joint
/// gain.
fn is_needed(
    examination: &Examination,
    member: usize,
    others: &[usize],
    added: &[f64],
    joint_gain: f64,
    thresholds: &Thresholds,
) -> bool {
    let p_value = score_given(examination, member, others).1;
    added.iter().sum::<f64>() > thresholds.least_joint_share * joint_gain
        && significant(p_value, examination.tests, added, thresholds)
}

/// Adds the effect with the largest added gain as long as it is needed.
fn select_forwards(examination: &Examination, effects: &[usize], members: &mut Vec<usize>, thresholds: &Thresholds) {
    while members.len() < thresholds.most_joint_effects {
        let present = joint_gains(examination, members);
        let next = effects
            .iter()
            .copied()
            .filter(|i| !members.contains(i))
            .map(|i| (i, added_gains(examination, i, members, &present)))
            .max_by(|a, b| a.1.iter().sum::<f64>().total_cmp(&b.1.iter().sum::<f64>()));
        let Some((next, added)) = next else { return };
        if !is_needed(examination, next, members, &added, present.iter().sum(), thresholds) {
            return;
        }
        members.push(next);
    }
}

/// Removes the member with the smallest added gain as long as it is not needed. Returns whether any was removed.
fn remove_backwards(examination: &Examination, members: &mut Vec<usize>, thresholds: &Thresholds) -> bool {
    let before = members.len();
    while members.len() > 1 {
        let joint_gain: f64 = joint_gains(examination, members).iter().sum();
        let least = (0..members.len())
            .map(|i| {
                let others: Vec<usize> = members.iter().copied().filter(|m| *m != members[i]).collect();
                let added = added_gains(examination, members[i], &others, &joint_gains(examination, &others));
                let needed = is_needed(examination, members[i], &others, &added, joint_gain, thresholds);
                (i, needed, added.iter().sum::<f64>())
            })
            .min_by(|a, b| a.2.total_cmp(&b.2));
        match least {
            Some((i, false, _)) => members.remove(i),
            _ => break,
        };
    }
    members.len() < before
}
