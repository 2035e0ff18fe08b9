//! From the decision on an examination to the effects that are tried.

use super::state::State;
use crate::diagnose::added_effect::AddedEffect;
use crate::diagnose::examination::Examination;
use crate::diagnose::held_out::HeldOut;
use crate::diagnose::round::RoundOutcome;
use crate::diagnose::stepwise_selection::score_given;
use crate::diagnose::thresholds::Thresholds;

/// Effects that a decision proposes to add, by their places in [`Examination::evidence`].
#[derive(Debug, Clone, Copy)]
pub(super) struct Proposal<'a> {
    /// The effect with the most evidence.
    pub effect: usize,
    /// Further effects that explain the residuals together with it.
    pub jointly_with: &'a [usize],
    /// Names of effects that the captures cannot distinguish from it.
    pub indistinguishable: &'a [String],
}

impl Proposal<'_> {
    fn members(&self) -> Vec<usize> {
        std::iter::once(self.effect).chain(self.jointly_with.iter().copied()).collect()
    }

    /// Why no trial is made: too many rounds or rejections before it, or too little to gain. `None` where one is.
    pub fn refusal(&self, state: &State, examination: &Examination, thresholds: &Thresholds) -> Option<RoundOutcome> {
        let (rounds, rejected) = (state.rounds.len(), state.memory.tried.rejected.len());
        if rounds >= thresholds.most_rounds {
            return Some(RoundOutcome::RoundLimit { rounds });
        }
        if rejected >= thresholds.most_rejected {
            return Some(RoundOutcome::RejectionLimit { rejected });
        }
        let gain: f64 = self.members().into_iter().map(|i| examination.evidence[i].gain()).sum();
        let (share_of_cost, least_share) = (gain / examination.cost(), least_share_worth_a_trial(thresholds));
        (share_of_cost < least_share).then_some(RoundOutcome::Negligible { share_of_cost, least_share })
    }

    /// The proposed effects in order, with the errors `present` before any of them. The p-value of each is given those before it;
    /// each lists the names of itself and those after it.
    pub fn effects(&self, examination: &Examination, present: &HeldOut) -> Vec<AddedEffect> {
        let members = self.members();
        let effect = |i: usize| {
            let evidence = examination.evidence[members[i]].clone();
            let p_value = match i {
                0 => evidence.p_value,
                _ => score_given(examination, members[i], &members[..i]).1,
            };
            AddedEffect {
                effects: members[i..].iter().map(|m| examination.evidence[*m].name.clone()).collect(),
                indistinguishable: if i == 0 { self.indistinguishable.to_vec() } else { Vec::new() },
                of_other_technologies: of_other_technologies(examination, members[i]),
                placements_not_told_apart: Vec::new(),
                p_value: (p_value * examination.tests as f64).min(1.0),
                after: present.clone(),
                gain_percent: None,
                evidence,
            }
        };
        (0..members.len()).map(effect).collect()
    }
}

/// Share of an effect's gain from which on an effect of another technology is its rival, however well they are told apart: the
/// shape of neither is exactly that of a camera.
const RIVALS_SHARE: f64 = 0.1;

/// Names of the effects that cameras of the technologies of effect number `place` do not have, and that explain a part of the
/// same, by falling gain. None for an effect of any technology, and where the technology is declared: then no others are
/// tested.
fn of_other_technologies(examination: &Examination, place: usize) -> Vec<String> {
    let technologies = |i: usize| examination.evidence[i].block.piece().map_or(&[][..], |piece| piece.technologies());
    let (of_effect, gain) = (technologies(place), examination.evidence[place].gain());
    if of_effect.is_empty() {
        return Vec::new();
    }
    let is_of_others = |i: &usize| {
        !technologies(*i).is_empty() && technologies(*i).iter().all(|technology| !of_effect.contains(technology))
    };
    let others = (0..examination.evidence.len()).filter(is_of_others);
    let rivals = others.filter(|i| examination.evidence[*i].gain() > RIVALS_SHARE * gain);
    rivals.map(|i| examination.evidence[i].name.clone()).collect()
}

/// Share of the cost that effects must be predicted to explain to be tried: that of half the fall of the held-out error that they
/// would have to bring, because predictions are uncertain. In a thousand frames much less is significant.
fn least_share_worth_a_trial(thresholds: &Thresholds) -> f64 {
    // An error that falls by p per cent leaves (1 − p / 100)² of the cost.
    let fall = 0.5 * thresholds.least_held_out_gain_percent / 100.0;
    1.0 - (1.0 - fall).powi(2)
}

#[cfg(test)]
mod tests {
    use super::super::linear_bench::{LinearBench, regressor};
    use super::*;
    use crate::diagnose::decision::Decision;
    use crate::diagnose::linear_examination::{Planted, examined, place};
    use crate::diagnose::round::Round;

    #[test]
    fn trials_end_with_too_many_rounds_or_rejections_or_too_little_to_gain() {
        let bench = LinearBench::new(&[("range_offset", 0.5, regressor(1))]);
        let e = examined(Planted { a: 0.3, ..Planted::default() }, 5);
        let effect = place(&e, "a");
        let proposal = Proposal { effect, jointly_with: &[], indistinguishable: &[] };
        let by_default = Thresholds::default();
        let mut state = bench.state(&[]);
        assert_eq!(proposal.refusal(&state, &e, &by_default), None);
        // Half of a fall that this effect does not bring: 2 · 12 % of the error take more than 20 % of the cost.
        let demanding = Thresholds { least_held_out_gain_percent: 24.0, ..by_default };
        let share_of_cost = e.evidence[effect].gain() / e.cost();
        let negligible = RoundOutcome::Negligible { share_of_cost, least_share: 1.0 - 0.88_f64.powi(2) };
        assert_eq!(proposal.refusal(&state, &e, &demanding), Some(negligible));
        state.memory.tried.rejected = vec!["b".to_owned(); by_default.most_rejected];
        assert_eq!(proposal.refusal(&state, &e, &demanding), Some(RoundOutcome::RejectionLimit { rejected: 3 }));
        state.rounds = (0..by_default.most_rounds).map(|_| Round::new(&e, Decision::Nothing, Vec::new())).collect();
        assert_eq!(proposal.refusal(&state, &e, &demanding), Some(RoundOutcome::RoundLimit { rounds: 9 }));
    }

    #[test]
    fn each_effect_is_tested_given_those_before_it() {
        let bench = LinearBench::new(&[("range_offset", 0.5, regressor(1))]);
        let e = examined(Planted { a: 0.3, with_twin: true, ..Planted::default() }, 2);
        let [a, twin] = ["a", "twin"].map(|name| place(&e, name));
        let instead = ["b".to_owned()];
        let proposal = Proposal { effect: a, jointly_with: &[twin], indistinguishable: &instead };
        let effects = proposal.effects(&e, &bench.state(&[]).present.held_out);
        assert_eq!(
            (&effects[0].effects[..], &effects[1].effects[..]),
            (&["a", "twin"].map(str::to_owned)[..], &["twin".to_owned()][..])
        );
        assert_eq!((&effects[0].indistinguishable[..], effects[1].indistinguishable.len()), (&instead[..], 0));
        // Alone both are significant; with the first in the model, the twin is not.
        assert!(e.evidence[twin].p_value < 1e-6);
        assert!(effects[0].p_value < 1e-6 && effects[1].p_value > 0.05, "{}", effects[1].p_value);
    }
}
