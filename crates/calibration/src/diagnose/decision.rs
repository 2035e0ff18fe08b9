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
        /// The competitor.
        competitor: Competitor,
    },
}

/// A competitor of named effects: they have to explain most of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Competitor {
    /// The best free function of a covariate.
    FreeFunction,
    /// A plane of its own in every frame.
    FramePlanes,
}

/// Effects that a decision must not propose.
#[derive(Debug, Clone, Copy, Default)]
pub struct RuledOut<'a> {
    /// Names of effects that were tried in vain: they are not proposed again, but count among those that explain the residuals.
    pub rejected: &'a [String],
    /// Places of effects that explain nothing.
    pub refuted: &'a [usize],
}

impl RuledOut<'_> {
    fn is_rejected(&self, evidence: &Evidence) -> bool {
        self.rejected.contains(&evidence.name)
    }
}

/// Decides on an examination and on the planes by which single frames deviate from the same model. Candidates explaining less
/// than `least_share` of the cost are ignored.
pub fn decide(
    examination: &Examination,
    planes: &[FramePlane],
    least_share: f64,
    ruled_out: RuledOut<'_>,
    thresholds: &Thresholds,
) -> Decision {
    let candidates = Candidates::new(examination, ruled_out, least_share, thresholds);
    let best_free = candidates.significant_free.first().copied();
    // The gain of the frames' planes, half of χ² less its three degrees of freedom: an effect that is present takes it up.
    let of_all_planes: f64 = planes.iter().map(|p| 0.5 * (p.statistic - 3.0)).sum();
    let Some(selected) = candidates.selected(ruled_out) else {
        let (explained, competitor) = (0.0, Competitor::FreeFunction);
        return best_free.map_or(Decision::Nothing, |free| Decision::Unexplained { free, explained, competitor });
    };
    let despite_unexplained = |free: usize, explained: f64, competitor: Competitor| match candidates.robust_effect() {
        Some(effect) => Decision::Add {
            effect,
            jointly_with: Vec::new(),
            indistinguishable: candidates.not_told_apart(&[effect]),
            explained,
            of_planes: 0.5 * examination.evidence[effect].score.statistic / of_all_planes.max(f64::MIN_POSITIVE),
            leaves_unexplained: true,
        },
        None => Decision::Unexplained { free, explained, competitor },
    };
    let explained = selected.gain();
    let mut share = 1.0;
    if let Some((free, left)) = candidates.largest_free_function_beside(&selected) {
        share = explained / (explained + left);
        if share < thresholds.least_explained {
            return despite_unexplained(best_free.unwrap_or(free), share, Competitor::FreeFunction);
        }
    }
    // Standard deviation of half the sum of χ² with three degrees of freedom each.
    let scatter = 0.5 * (6.0 * planes.len() as f64).sqrt();
    let excess = (of_all_planes - thresholds.plane_scatter * scatter).max(f64::MIN_POSITIVE);
    let of_planes = 0.5 * selected.statistic / excess;
    if of_planes < thresholds.least_explained_of_planes {
        let free = best_free.unwrap_or_else(|| candidates.free[0]);
        return despite_unexplained(free, of_planes, Competitor::FramePlanes);
    }
    Decision::Add {
        effect: selected.members[0],
        jointly_with: selected.members[1..].to_vec(),
        indistinguishable: candidates.not_told_apart(&selected.members),
        explained: share,
        of_planes,
        leaves_unexplained: false,
    }
}

/// The candidates of an examination in groups, by their places.
struct Candidates<'a> {
    examination: &'a Examination,
    thresholds: &'a Thresholds,
    /// Effects that are not refuted.
    effects: Vec<usize>,
    /// Those of them that were not rejected, by falling penalised merit.
    ranked: Vec<usize>,
    /// Free functions.
    free: Vec<usize>,
    /// Those of them that are significant, by falling merit.
    significant_free: Vec<usize>,
    /// Merit that a candidate must exceed.
    least: f64,
}

impl<'a> Candidates<'a> {
    fn new(
        examination: &'a Examination,
        ruled_out: RuledOut<'_>,
        least_share: f64,
        thresholds: &'a Thresholds,
    ) -> Self {
        let all = &examination.evidence;
        let is_free = |i: &usize| all[*i].along.is_some();
        let (free, effects): (Vec<usize>, Vec<usize>) = (0..all.len()).partition(is_free);
        let effects: Vec<usize> = effects.into_iter().filter(|i| !ruled_out.refuted.contains(i)).collect();
        let mut ranked: Vec<usize> = effects.iter().copied().filter(|i| !ruled_out.is_rejected(&all[*i])).collect();
        ranked.sort_by(|a, b| penalized_merit(examination, *b).total_cmp(&penalized_merit(examination, *a)));
        let least = least_share * examination.cost();
        let mut candidates =
            Self { examination, thresholds, effects, ranked, free, significant_free: Vec::new(), least };
        let tests = candidates.free.len();
        let mut significant_free: Vec<usize> =
            candidates.free.iter().copied().filter(|i| candidates.is_significant(*i, tests)).collect();
        significant_free.sort_by(|a, b| merit(&all[*b]).total_cmp(&merit(&all[*a])));
        candidates.significant_free = significant_free;
        candidates
    }

    fn is_significant(&self, candidate: usize, tests: usize) -> bool {
        let evidence = &self.examination.evidence[candidate];
        significant(evidence.p_value, tests, &evidence.gains, self.thresholds) && merit(evidence) > self.least
    }

    /// The effects that explain the residuals together, the one to be tried first in front. `None` where no effect is
    /// significant.
    fn selected(&self, ruled_out: RuledOut<'_>) -> Option<SelectedEffects> {
        let (examination, all) = (self.examination, &self.examination.evidence);
        let first = self.ranked.iter().copied().find(|i| self.is_significant(*i, examination.tests))?;
        let mut selected = SelectedEffects::stepwise(examination, &self.effects, first, self.thresholds);
        // An effect that was rejected is added jointly with another one at most: the first that was not tried moves to the front.
        let untried = selected.members.iter().position(|i| !ruled_out.is_rejected(&all[*i]));
        selected.members[..=untried.unwrap_or(0)].rotate_right(1);
        let is_excluded = |i: &usize| ruled_out.refuted.contains(i) || ruled_out.is_rejected(&all[*i]);
        let excluded: Vec<usize> = (0..all.len()).filter(is_excluded).collect();
        let first = selected.members[0];
        selected.members[0] = in_own_form(examination, first, &selected.members, &excluded, self.thresholds);
        Some(selected)
    }

    /// The free function with the largest gain that it adds to the selected effects, with this gain; 0 where it is not
    /// significant.
    fn largest_free_function_beside(&self, selected: &SelectedEffects) -> Option<(usize, f64)> {
        let added = |i: usize| {
            let added = added_gains(self.examination, i, &selected.members, &selected.gains);
            let p_value = score_given(self.examination, i, &selected.members).1;
            let counts = significant(p_value, self.free.len(), &added, self.thresholds);
            (i, if counts { added.iter().sum::<f64>() } else { 0.0 })
        };
        self.free.iter().copied().map(added).max_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Names of the effects that cannot be distinguished from the first of the selected ones.
    fn not_told_apart(&self, selected: &[usize]) -> Vec<String> {
        let places = indistinguishable(self.examination, selected[0], selected, self.thresholds);
        places.into_iter().map(|i| self.examination.evidence[i].name.clone()).collect()
    }

    /// The first of the ranked effects that holds although something is unexplained: it is significant by the scatter of its
    /// score between frames, which is valid however residuals within a frame are correlated, and it keeps its gain when fitted
    /// jointly with each of the strongest free functions, unless the function adds little to it.
    fn robust_effect(&self) -> Option<usize> {
        let Self { examination, thresholds, .. } = self;
        let Thresholds { least_kept_gain, least_explained, .. } = **thresholds;
        let (lin, all) = (&examination.linearization, &examination.evidence);
        let least = self.least.max(thresholds.least_named_share * examination.cost());
        let free = &self.significant_free;
        let competitors = &free[..free.len().min(thresholds.most_competing_functions)];
        self.ranked.iter().copied().find(|candidate| {
            let effect = &all[*candidate];
            let gain = effect.gain();
            significant(effect.p_value, examination.tests, &effect.gains, thresholds)
                && merit(effect) > least
                && effect.score.clustered_p_value * (examination.tests as f64) < thresholds.clustered_level
                && competitors.iter().map(|i| &all[*i]).all(|competitor| {
                    let joint: f64 = lin.held_out_gain(&[competitor.index, effect.index]).iter().sum();
                    joint - competitor.gain() > least_kept_gain * gain
                        || (joint - gain) * least_explained < gain * (1.0 - least_explained)
                })
        })
    }
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

/// The effect `first`, or another that cannot be distinguished from it and acts in the form of its own equation where `first`
/// does not: a range offset as a factor of depth is a radial range, and the latter is the simpler name. Not one of more
/// parameters; of several the one with the largest merit; none of the `excluded`.
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
