//! Which effect to add, if any.
//!
//! p-values alone name something in nearly every capture whose fault the catalogue does not have. So an effect has to
//! - be significant, corrected for the number of effects and constants tried;
//! - gain on frames that its estimate has not seen, and on most of them rather than on one;
//! - together with further named effects explain most of what a free function of anything explains;
//! - or, where something else is there as well, gain beside every free function nearly what it gains alone, and by the
//!   frames' own scatter: what only mimics a map loses its gain beside the map.

use super::evidence::{Evidence, Examination, LEVEL, t_of};
use super::frames::FramePlane;
use super::together::{Together, added, beside};

/// Share of the explicable that named effects have to explain.
const EXPLAINED: f64 = 0.75;
/// Mean gain over its standard error below which the gain may be one frame's accident.
const STEADY: f64 = 1.2;
/// Share of what planes of the frames' own explain that named effects have to explain.
const FRAMES_EXPLAINED: f64 = 0.7;
/// Standard deviations by which noise may make planes of the frames' own look larger than they are.
const PLANES_SCATTER: f64 = 1.5;
/// Paired difference of gains, over its standard error, that tells two effects apart.
const TOLD_APART: f64 = 2.0;

/// Beside each free function that explains something, an effect that is not a part of what that one explains keeps at least
/// this share of its gain; or else the free function explains little more than the effect does.
const KEPT: f64 = 0.25;
/// Level of the test of such an effect by the frames' scatter, corrected for the number of effects.
const LEVEL_BY_FRAMES: f64 = 0.03;
/// Share of the residuals' squares that an effect has to explain to be named while something else is unexplained.
const WORTH_NAMING: f64 = 0.01;
/// Free functions, by falling merit, that it is put beside.
const MOST_BESIDE: usize = 4;

/// What to do after a round.
#[derive(Debug, Clone)]
pub enum Decision {
    /// Nothing is left that these data show.
    Nothing,
    /// An effect is missing.
    Add {
        /// Its place in [`Examination::evidence`].
        effect: usize,
        /// Further effects that explain what it leaves: their places.
        beside: Vec<usize>,
        /// Effects that these captures cannot tell from it.
        indistinguishable: Vec<String>,
        /// Share that these effects together explain of what they and any free function explain.
        explained: f64,
        /// What they explain over what planes of the frames' own explain.
        of_planes: f64,
        /// Whether something else is left that no named effect explains: the effect holds beside it.
        beside_unexplained: bool,
    },
    /// Something is left that no named effect explains.
    Unexplained {
        /// The free function that explains most: its place in [`Examination::evidence`].
        free: usize,
        /// Share of it that the best named effects explain.
        explained: f64,
    },
}

/// What a candidate is worth: the gain on left-out frames, but no more than what its score test expects. The first is
/// noisy where few frames carry it, the second blind to what residuals of a frame share.
pub fn merit(evidence: &Evidence) -> f64 {
    evidence.gain().min(0.5 * evidence.score.statistic - evidence.score.rank as f64)
}

/// What a candidate is worth beside others: the simpler wins unless the other explains more than its parameters do by
/// chance (Schwarz 1978, with frames as observations).
pub(super) fn rank(examination: &Examination, effect: usize) -> f64 {
    let evidence = &examination.evidence[effect];
    let frames = examination.linearization.cluster_count().max(2) as f64;
    merit(evidence) - evidence.score.rank as f64 * (frames.ln() - 1.0)
}

/// Whether a candidate counts: by its p-value, corrected for the number of `tests`, and on more than one frame.
pub(super) fn significant(p_value: f64, tests: usize, gains: &[f64]) -> bool {
    p_value * (tests as f64) < LEVEL && gains.iter().sum::<f64>() > 0.0 && t_of(gains) > STEADY
}

/// Gains of one over those of the other, frame by frame.
pub(super) fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

/// Decides on an examination and the frames' own planes beside the same model. What explains less than `least_share` of the
/// residuals' squares is let be, and the effects `rejected` are not proposed again.
pub fn decide(examination: &Examination, planes: &[FramePlane], least_share: f64, rejected: &[String]) -> Decision {
    let all = &examination.evidence;
    let free_count = examination.probes().count();
    let effects: Vec<usize> = (0..all.len()).filter(|i| all[*i].along.is_none()).collect();
    let free: Vec<usize> = (0..all.len()).filter(|i| all[*i].along.is_some()).collect();
    let least = least_share * examination.cost();
    let is_significant = |e: &Evidence, tests: usize| significant(e.p_value, tests, &e.gains) && merit(e) > least;
    let mut free_that_count: Vec<usize> =
        free.iter().copied().filter(|i| is_significant(&all[*i], free_count)).collect();
    free_that_count.sort_by(|a, b| merit(&all[*b]).total_cmp(&merit(&all[*a])));
    let best_free = free_that_count.first().copied();
    let ranked = ranked(examination, &effects, rejected);
    let named = ranked.iter().copied().find(|i| is_significant(&all[*i], examination.tests));
    let Some(first) = named else {
        return best_free.map_or(Decision::Nothing, |free| Decision::Unexplained { free, explained: 0.0 });
    };
    let mut together = Together::explain(examination, &effects, first);
    // What was tried and brought nothing is added at most beside another.
    let untried = together.members.iter().position(|i| !rejected.contains(&all[*i].name));
    together.members[..=untried.unwrap_or(0)].rotate_right(1);
    let first = together.members[0];
    // What free functions explain beside them.
    let explained = together.explained();
    let left = free
        .iter()
        .copied()
        .map(|i| {
            let added = added(examination, i, &together.members, &together.gains);
            let counts = significant(beside(examination, i, &together.members).1, free_count, &added);
            (i, if counts { added.iter().sum::<f64>() } else { 0.0 })
        })
        .max_by(|a, b| a.1.total_cmp(&b.1));
    let mut share = 1.0;
    // Planes of the frames' own compete too: an effect that is there takes them up.
    let own_planes: f64 = planes.iter().map(|p| 0.5 * (p.statistic - 3.0)).sum();
    let instead = |free: usize, explained: f64| match apart(examination, &ranked, &free_that_count, least) {
        Some(effect) => {
            let indistinguishable = indistinguishable(examination, effect, &[effect]);
            let of_planes = 0.5 * all[effect].score.statistic / own_planes.max(f64::MIN_POSITIVE);
            let beside = Vec::new();
            Decision::Add { effect, beside, indistinguishable, explained, of_planes, beside_unexplained: true }
        }
        None => Decision::Unexplained { free, explained },
    };
    if let Some((free, left)) = left {
        share = explained / (explained + left);
        if share < EXPLAINED {
            return instead(best_free.unwrap_or(free), share);
        }
    }
    // Half of χ² with three degrees of freedom per frame scatters by this.
    let scatter = 0.5 * (6.0 * planes.len() as f64).sqrt();
    let of_planes = 0.5 * together.statistic / (own_planes - PLANES_SCATTER * scatter).max(f64::MIN_POSITIVE);
    if of_planes < FRAMES_EXPLAINED {
        let free = best_free.unwrap_or_else(|| free[0]);
        return instead(free, of_planes);
    }
    let indistinguishable = indistinguishable(examination, first, &together.members);
    let beside = together.members[1..].to_vec();
    Decision::Add { effect: first, beside, indistinguishable, explained: share, of_planes, beside_unexplained: false }
}

/// Effects by falling rank, without those that were rejected.
fn ranked(examination: &Examination, effects: &[usize], rejected: &[String]) -> Vec<usize> {
    let all = &examination.evidence;
    let mut ranked: Vec<usize> = effects.iter().copied().filter(|i| !rejected.contains(&all[*i].name)).collect();
    ranked.sort_by(|a, b| rank(examination, *b).total_cmp(&rank(examination, *a)));
    ranked
}

/// The first effect that is there whatever else is: its score is significant by its scatter from frame to frame, which holds
/// whatever the residuals of a frame share, and it is no mere part of what a free function explains (`free`, by falling
/// merit).
fn apart(examination: &Examination, ranked: &[usize], free: &[usize], least: f64) -> Option<usize> {
    let (lin, all) = (&examination.linearization, &examination.evidence);
    let least = least.max(WORTH_NAMING * examination.cost());
    let competitors = &free[..free.len().min(MOST_BESIDE)];
    ranked.iter().copied().find(|candidate| {
        let effect = &all[*candidate];
        let own = effect.gain();
        significant(effect.p_value, examination.tests, &effect.gains)
            && merit(effect) > least
            && effect.score.clustered_p_value * (examination.tests as f64) < LEVEL_BY_FRAMES
            && competitors.iter().map(|i| &all[*i]).all(|competitor| {
                let together: f64 = lin.held_out_gain(&[competitor.index, effect.index]).iter().sum();
                together - competitor.gain() > KEPT * own || (together - own) * EXPLAINED < own * (1.0 - EXPLAINED)
            })
    })
}

/// Effects that these captures cannot tell from effect `first`, those of `stack` left out.
fn indistinguishable(examination: &Examination, first: usize, stack: &[usize]) -> Vec<String> {
    let (lin, all) = (&examination.linearization, &examination.evidence);
    (0..all.len())
        .filter(|i| all[*i].along.is_none() && !stack.contains(i) && all[*i].gain() > 0.0)
        .filter(|i| {
            let apart = difference(&all[first].gains, &all[*i].gains);
            let beside = lin.score_adjusted(all[first].index, &[all[*i].index]).p_value;
            t_of(&apart) < TOLD_APART && beside > LEVEL
        })
        .map(|i| all[i].name.clone())
        .collect()
}
