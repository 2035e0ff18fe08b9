//! The decision of a round: which effect to add, if any.
//!
//! p-values alone would name some effect in nearly every capture whose error the catalogue does not have. So an effect has to
//! - be significant, corrected for the number of effects and constants tried;
//! - gain on held-out frames, and on most of them rather than on one;
//! - explain, jointly with further named effects, most of what a free function of any covariate explains;
//! - or else, where something remains unexplained, retain most of its gain when fitted jointly with each free function, and be
//!   significant by the scatter between frames: an effect that only imitates a map loses its gain given the map.

use depthcal_statistics::mean_to_standard_error;

use super::evidence::{Evidence, difference};
use super::examination::Examination;
use super::frame_planes::FramePlane;
use super::merit::{merit, penalized_merit, significant};
use super::stepwise_selection::{SelectedEffects, added_gains, score_given};
use super::thresholds::Thresholds;

/// The decision of a round. Candidates are given by their places in [`Examination::evidence`].
#[derive(Debug, Clone)]
pub enum Decision {
    /// The residuals show nothing that the model lacks.
    Nothing,
    /// An effect is missing.
    Add {
        /// The effect.
        effect: usize,
        /// Further effects that explain the residuals together with it.
        jointly_with: Vec<usize>,
        /// Names of effects that these captures cannot distinguish from it.
        indistinguishable: Vec<String>,
        /// Share that these effects explain of what they and any free function explain together.
        explained: f64,
        /// Score statistic of these effects over that of the planes by which single frames deviate.
        of_planes: f64,
        /// Whether something remains that no named effect explains.
        leaves_unexplained: bool,
    },
    /// Something is missing that no named effect explains.
    Unexplained {
        /// The free function with the largest merit.
        free: usize,
        /// Share of the competitor that the best named effects explain.
        explained: f64,
        /// What named effects were compared with.
        competitor: Competitor,
    },
}

/// What named effects have to explain most of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Competitor {
    /// The best free function of a covariate.
    FreeFunction,
    /// A plane of its own in every frame.
    FramePlanes,
}

/// Decides on an examination and on the planes by which single frames deviate from the same model.
///
/// Candidates explaining less than `least_share` of the cost are ignored; effects with a name in `rejected` are not proposed
/// again, and those at the places `refuted` explain nothing.
pub fn decide(
    examination: &Examination,
    planes: &[FramePlane],
    least_share: f64,
    rejected: &[String],
    refuted: &[usize],
    thresholds: &Thresholds,
) -> Decision {
    let all = &examination.evidence;
    let free_count = examination.free_functions().count();
    let effects: Vec<usize> = (0..all.len()).filter(|i| all[*i].along.is_none() && !refuted.contains(i)).collect();
    let free: Vec<usize> = (0..all.len()).filter(|i| all[*i].along.is_some()).collect();
    let least = least_share * examination.cost();
    let is_significant =
        |e: &Evidence, tests: usize| significant(e.p_value, tests, &e.gains, thresholds) && merit(e) > least;
    let mut significant_free: Vec<usize> =
        free.iter().copied().filter(|i| is_significant(&all[*i], free_count)).collect();
    significant_free.sort_by(|a, b| merit(&all[*b]).total_cmp(&merit(&all[*a])));
    let best_free = significant_free.first().copied();
    let ranked = ranked(examination, &effects, rejected);
    let named = ranked.iter().copied().find(|i| is_significant(&all[*i], examination.tests));
    let Some(first) = named else {
        return best_free.map_or(Decision::Nothing, |free| Decision::Unexplained {
            free,
            explained: 0.0,
            competitor: Competitor::FreeFunction,
        });
    };
    let mut selected = SelectedEffects::stepwise(examination, &effects, first, thresholds);
    // An effect that was rejected is added jointly with another one at most: the first that was not tried moves to the front.
    let untried = selected.members.iter().position(|i| !rejected.contains(&all[*i].name));
    selected.members[..=untried.unwrap_or(0)].rotate_right(1);
    let excluded: Vec<usize> =
        (0..all.len()).filter(|i| refuted.contains(i) || rejected.contains(&all[*i].name)).collect();
    let first = in_own_form(examination, selected.members[0], &selected.members, &excluded, thresholds);
    selected.members[0] = first;
    // The largest gain that a free function adds to the selected effects.
    let explained = selected.gain();
    let left = free
        .iter()
        .copied()
        .map(|i| {
            let added = added_gains(examination, i, &selected.members, &selected.gains);
            let p_value = score_given(examination, i, &selected.members).1;
            let counts = significant(p_value, free_count, &added, thresholds);
            (i, if counts { added.iter().sum::<f64>() } else { 0.0 })
        })
        .max_by(|a, b| a.1.total_cmp(&b.1));
    let not_told_apart = |first: usize, selected: &[usize]| -> Vec<String> {
        let places = indistinguishable(examination, first, selected, thresholds);
        places.into_iter().map(|i| all[i].name.clone()).collect()
    };
    let mut share = 1.0;
    // The gain of the frames' planes, half of χ² less its three degrees of freedom: an effect that is present takes it up.
    let own_planes: f64 = planes.iter().map(|p| 0.5 * (p.statistic - 3.0)).sum();
    let with_unexplained = |free: usize, explained: f64, competitor: Competitor| match robust_effect(
        examination,
        &ranked,
        &significant_free,
        least,
        thresholds,
    ) {
        Some(effect) => Decision::Add {
            effect,
            jointly_with: Vec::new(),
            indistinguishable: not_told_apart(effect, &[effect]),
            explained,
            of_planes: 0.5 * all[effect].score.statistic / own_planes.max(f64::MIN_POSITIVE),
            leaves_unexplained: true,
        },
        None => Decision::Unexplained { free, explained, competitor },
    };
    if let Some((free, left)) = left {
        share = explained / (explained + left);
        if share < thresholds.least_explained {
            return with_unexplained(best_free.unwrap_or(free), share, Competitor::FreeFunction);
        }
    }
    // Standard deviation of half the sum of χ² with three degrees of freedom each.
    let scatter = 0.5 * (6.0 * planes.len() as f64).sqrt();
    let of_planes = 0.5 * selected.statistic / (own_planes - thresholds.plane_scatter * scatter).max(f64::MIN_POSITIVE);
    if of_planes < thresholds.least_explained_of_planes {
        let free = best_free.unwrap_or_else(|| free[0]);
        return with_unexplained(free, of_planes, Competitor::FramePlanes);
    }
    Decision::Add {
        effect: first,
        jointly_with: selected.members[1..].to_vec(),
        indistinguishable: not_told_apart(first, &selected.members),
        explained: share,
        of_planes,
        leaves_unexplained: false,
    }
}

/// Effects by falling penalised merit, without those that were rejected.
fn ranked(examination: &Examination, effects: &[usize], rejected: &[String]) -> Vec<usize> {
    let all = &examination.evidence;
    let mut ranked: Vec<usize> = effects.iter().copied().filter(|i| !rejected.contains(&all[*i].name)).collect();
    ranked.sort_by(|a, b| penalized_merit(examination, *b).total_cmp(&penalized_merit(examination, *a)));
    ranked
}

/// The first of the `ranked` effects that holds although something is unexplained: it is significant by the scatter of its
/// score between frames, which is valid however residuals within a frame are correlated, and it keeps its gain when fitted
/// jointly with each of the strongest free functions (`free`, by falling merit), unless the function adds little to it.
fn robust_effect(
    examination: &Examination,
    ranked: &[usize],
    free: &[usize],
    least: f64,
    thresholds: &Thresholds,
) -> Option<usize> {
    let Thresholds { least_kept_gain, least_explained, .. } = *thresholds;
    let (lin, all) = (&examination.linearization, &examination.evidence);
    let least = least.max(thresholds.least_named_share * examination.cost());
    let competitors = &free[..free.len().min(thresholds.most_competing_functions)];
    ranked.iter().copied().find(|candidate| {
        let effect = &all[*candidate];
        let own = effect.gain();
        significant(effect.p_value, examination.tests, &effect.gains, thresholds)
            && merit(effect) > least
            && effect.score.clustered_p_value * (examination.tests as f64) < thresholds.clustered_level
            && competitors.iter().map(|i| &all[*i]).all(|competitor| {
                let joint: f64 = lin.held_out_gain(&[competitor.index, effect.index]).iter().sum();
                joint - competitor.gain() > least_kept_gain * own
                    || (joint - own) * least_explained < own * (1.0 - least_explained)
            })
    })
}

/// The effects that these captures cannot distinguish from effect `first`, without the `selected` ones.
fn indistinguishable(
    examination: &Examination,
    first: usize,
    selected: &[usize],
    thresholds: &Thresholds,
) -> Vec<usize> {
    let (lin, all) = (&examination.linearization, &examination.evidence);
    (0..all.len())
        .filter(|i| all[*i].along.is_none() && !selected.contains(i) && all[*i].gain() > 0.0)
        .filter(|i| {
            let difference = difference(&all[first].gains, &all[*i].gains);
            let given_other = lin.score_adjusted(all[first].index, &[all[*i].index]).p_value;
            mean_to_standard_error(&difference) < thresholds.distinguishing_t && given_other > thresholds.level
        })
        .collect()
}

/// The effect `first`, or another that cannot be distinguished from it and acts in the form of its own equation where `first` does not:
/// a range offset as a factor of depth is a radial range, and the latter is the simpler name. Not one of more parameters; of several the
/// one with the largest merit; none of the `excluded`.
fn in_own_form(
    examination: &Examination,
    first: usize,
    selected: &[usize],
    excluded: &[usize],
    thresholds: &Thresholds,
) -> usize {
    let all = &examination.evidence;
    let has_own_form = |i: &usize| all[*i].spec.placement.on.is_none();
    if has_own_form(&first) {
        return first;
    }
    let others = indistinguishable(examination, first, selected, thresholds).into_iter();
    let is_as_simple = |i: &usize| all[*i].score.rank <= all[first].score.rank;
    let others = others.filter(|i| has_own_form(i) && is_as_simple(i) && !excluded.contains(i));
    let by_merit = |a: &usize, b: &usize| penalized_merit(examination, *a).total_cmp(&penalized_merit(examination, *b));
    others.max_by(by_merit).unwrap_or(first)
}

#[cfg(test)]
mod tests;
