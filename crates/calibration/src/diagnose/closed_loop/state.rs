//! The state of the loop, and the one place where it changes.

use std::collections::BTreeSet;

use depthcal_model::PieceSpec;

use super::augmented_model::AugmentedModel;
use super::bench::Fitted;
use super::frames::Frames;
use crate::calibrate::ImplausibleScale;
use crate::diagnose::left_over::LeftOver;
use crate::diagnose::possible::Possible;
use crate::diagnose::round::{Round, RoundOutcome};

/// The state of the loop. Steps read it and return an [`Event`]; only [`State::apply`] changes it.
pub(super) struct State {
    /// The frames that are fitted.
    pub frames: Frames,
    /// The present model.
    pub model: AugmentedModel,
    /// Its fit.
    pub present: Fitted,
    /// The fit of the declared model to the same frames.
    pub first: Fitted,
    /// Decisions that later ones depend on.
    pub memory: Memory,
    /// Results for the report.
    pub findings: Findings,
    /// The rounds so far.
    pub rounds: Vec<Round>,
}

/// Decisions that later ones depend on.
#[derive(Clone, Default)]
pub(super) struct Memory {
    /// Trials of the present model. They end with it.
    pub tried: Tried,
    /// Lens effects that images do not show: they are not added again, whatever the model.
    pub hidden: Vec<String>,
    /// Largest merit of an added effect as a share of the cost.
    pub largest_share: f64,
    /// Whether a formula has been compared with all added effects.
    pub compared_with_formula: bool,
}

/// Effects that were tried in vain.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Tried {
    /// Those that a trial began with.
    pub rejected: Vec<String>,
    /// Those that were tried together.
    pub together: Vec<BTreeSet<String>>,
    /// Whether functions that the residuals depend on were searched.
    pub functions: bool,
    /// Whether all effects of depth were explained anew.
    pub anew: bool,
}

/// Results for the report.
#[derive(Default)]
pub(super) struct Findings {
    /// Declarations of the dataset that cannot be right.
    pub declarations: Vec<ImplausibleScale>,
    /// Structure in the residuals that no effect explains.
    pub left_over: Vec<LeftOver>,
    /// Effects that may be missing.
    pub possible: Vec<Possible>,
    /// Why no formula was found for the remaining structure.
    pub formula_refused: Option<String>,
}

/// The result of a step.
pub(super) enum Event {
    /// A decision begins a round.
    Decided(Box<Round>),
    /// A better model takes the place of the present one.
    Accepted(Box<Accepted>),
    /// Effects of the lens are removed from the present model.
    TakenOut(Box<TakenOut>),
    /// The effects of the last model, each given all others; some are possible, not certain.
    Judged(Box<Judged>),
    /// Effects were tried in vain.
    Rejected {
        /// Names of the effects that were tried together, the one that was found first.
        effects: Vec<String>,
        /// Why they are not in the model.
        because: Rejection,
    },
    /// Functions that explain the residuals together were searched; the model with them, where they are certain.
    ExplainedTogether(Option<Box<Accepted>>),
    /// All effects of depth were explained anew; the model with the explanations, where it is better.
    ExplainedAnew(Option<Box<Accepted>>),
    /// A formula was compared with all added effects; the model that has it instead of them, where it is better.
    FormulaCompared(Option<Box<Accepted>>),
    /// No formula describes what the present model leaves.
    FormulaRefused {
        /// Why.
        reason: String,
        /// A function of two covariates that explains something for certain.
        together: Option<LeftOver>,
    },
    /// No named effect explains something.
    Unexplained {
        /// It, for the report.
        left_over: Option<LeftOver>,
        /// The model with a free map, where this lowers the errors.
        with_map: Option<Box<(AugmentedModel, Fitted)>>,
    },
    /// Other frames are fitted than before.
    FramesChanged(Box<FramesChanged>),
    /// The rounds end: nothing is missing, or what is missing is not tried.
    Stopped(Option<RoundOutcome>),
}

/// A model that is better than the present one for certain.
pub(super) struct Accepted {
    pub model: AugmentedModel,
    pub present: Fitted,
    /// Largest merit of an added effect as a share of the cost.
    pub largest_share: f64,
    /// The outcome of the round, for its record.
    pub outcome: Option<RoundOutcome>,
}

/// The present model without effects of the lens.
pub(super) struct TakenOut {
    pub model: AugmentedModel,
    pub present: Fitted,
    /// The removed effects.
    pub effects: Vec<PieceSpec>,
}

/// The last model without effects whose gain is not certain given all others; the rest have their gains.
pub(super) struct Judged {
    pub model: AugmentedModel,
    pub present: Fitted,
    /// The removed effects that may be there.
    pub possible: Vec<Possible>,
}

/// Why effects that were tried are not in the model.
pub(super) enum Rejection {
    /// With them the errors on held-out frames are no smaller for certain; the first may still be missing.
    NoHeldOutGain(Option<Possible>),
    /// The model with them cannot be fitted.
    NotFitted(String),
}

/// The present and the declared model, fitted to other frames.
pub(super) struct FramesChanged {
    pub frames: Frames,
    /// The present model, with the errors of the models along the way.
    pub model: AugmentedModel,
    pub present: Fitted,
    pub first: Fitted,
}

/// How the loop goes on after an event.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Next {
    /// The model has changed: its residuals are examined.
    Examine,
    /// The model is the same, and so are its residuals: the decision is made again, without the effects that were tried.
    Decide,
    /// The round goes on.
    GoOn,
    /// No further round.
    Settled,
}

impl State {
    /// The state after the first fit.
    pub fn new(frames: Frames, first: Fitted, declarations: Vec<ImplausibleScale>) -> Self {
        Self {
            frames,
            model: AugmentedModel::default(),
            present: first.clone(),
            first,
            memory: Memory::default(),
            findings: Findings { declarations, ..Findings::default() },
            rounds: Vec::new(),
        }
    }

    /// Takes over the result of a step.
    pub fn apply(&mut self, event: Event) -> Next {
        match event {
            Event::Decided(round) => {
                self.rounds.push(*round);
                Next::GoOn
            }
            Event::Accepted(accepted) => self.accept(*accepted),
            Event::TakenOut(taken_out) => self.take_out(*taken_out),
            Event::Judged(judged) => {
                let Judged { model, present, possible } = *judged;
                (self.model, self.present) = (model, present);
                self.findings.possible.retain(|earlier| possible.iter().all(|p| p.spec.name != earlier.spec.name));
                self.findings.possible.extend(possible);
                Next::Examine
            }
            Event::Rejected { effects, because } => self.reject(effects, because),
            Event::ExplainedTogether(with) => {
                self.memory.tried.functions = true;
                with.map_or(Next::GoOn, |accepted| self.accept(*accepted))
            }
            Event::ExplainedAnew(anew) => {
                self.memory.tried.anew = true;
                anew.map_or(Next::GoOn, |accepted| self.accept(Accepted { outcome: None, ..*accepted }))
            }
            Event::FormulaCompared(instead) => {
                self.memory.compared_with_formula = true;
                instead.map_or(Next::GoOn, |accepted| self.accept(*accepted))
            }
            Event::FormulaRefused { reason, together } => {
                self.findings.formula_refused = Some(reason);
                self.findings.left_over.extend(together);
                Next::GoOn
            }
            Event::Unexplained { left_over, with_map } => self.leave_unexplained(left_over, with_map),
            Event::FramesChanged(changed) => {
                let FramesChanged { frames, model, present, first } = *changed;
                (self.frames, self.model, self.present, self.first) = (frames, model, present, first);
                Next::Examine
            }
            Event::Stopped(outcome) => {
                self.conclude_round(outcome);
                Next::Settled
            }
        }
    }

    /// A decision made under one model does not outlive it.
    fn accept(&mut self, accepted: Accepted) -> Next {
        (self.model, self.present) = (accepted.model, accepted.present);
        self.memory.tried = Tried::default();
        self.memory.largest_share = accepted.largest_share;
        self.conclude_round(accepted.outcome);
        Next::Examine
    }

    /// Trials stay in memory: the removed effects explain nothing that images show.
    fn take_out(&mut self, taken_out: TakenOut) -> Next {
        let TakenOut { model, present, effects } = taken_out;
        (self.model, self.present) = (model, present);
        self.memory.hidden.extend(effects.iter().map(|spec| spec.name.clone()));
        self.conclude_round(Some(RoundOutcome::TakenOut { effects }));
        Next::Examine
    }

    fn reject(&mut self, effects: Vec<String>, because: Rejection) -> Next {
        let outcome = match because {
            Rejection::NoHeldOutGain(possible) => {
                self.findings.possible.retain(|p| Some(&p.spec.name) != effects.first());
                self.findings.possible.extend(possible);
                RoundOutcome::NoHeldOutGain
            }
            Rejection::NotFitted(error) => RoundOutcome::NotFitted { error },
        };
        self.conclude_round(Some(outcome));
        let tried = &mut self.memory.tried;
        tried.together.extend((1..=effects.len()).map(|n| effects[..n].iter().cloned().collect()));
        tried.rejected.extend(effects.into_iter().next());
        Next::Decide
    }

    fn leave_unexplained(
        &mut self,
        left_over: Option<LeftOver>,
        with_map: Option<Box<(AugmentedModel, Fitted)>>,
    ) -> Next {
        self.findings.left_over.extend(left_over);
        let mut outcome = RoundOutcome::Reported;
        if let Some(with_map) = with_map {
            (self.model, self.present) = *with_map;
            if let Some(map) = self.model.added.last() {
                outcome = RoundOutcome::FreeMapAdded { map: map.evidence.spec.clone() };
            }
        }
        self.conclude_round(Some(outcome));
        Next::Settled
    }

    /// Records what came of the last round's decision.
    fn conclude_round(&mut self, outcome: Option<RoundOutcome>) {
        if let (Some(last), Some(outcome)) = (self.rounds.last_mut(), outcome) {
            last.outcome = Some(outcome);
        }
    }
}

#[cfg(test)]
mod tests {
    use depthcal_io::GainInterval;

    use super::super::linear_bench::{LinearBench, regressor};
    use super::*;
    use crate::diagnose::decision::Decision;
    use crate::diagnose::linear_examination::{Planted, examined};

    fn bench() -> LinearBench {
        LinearBench::new(&[("range_offset", 0.5, regressor(1)), ("radial_range", 0.5, regressor(2))])
    }

    fn rejected(names: &[&str], because: Rejection) -> Event {
        Event::Rejected { effects: names.iter().map(|name| (*name).to_owned()).collect(), because }
    }

    fn accepted(state: State) -> Event {
        let State { model, present, .. } = state;
        Event::Accepted(Box::new(Accepted { model, present, largest_share: 0.25, outcome: None }))
    }

    fn names(state: &State) -> Vec<&str> {
        state.model.added.iter().map(|effect| effect.evidence.name.as_str()).collect()
    }

    /// A state in its first round, in which two effects were tried in vain.
    fn after_rejection(bench: &LinearBench) -> State {
        let mut state = bench.state(&[]);
        let round = Round::new(&examined(Planted::default(), 1), Decision::Nothing, Vec::new());
        assert_eq!(state.apply(Event::Decided(Box::new(round))), Next::GoOn);
        let next = state.apply(rejected(&["incidence_bias", "quadratic_depth"], Rejection::NoHeldOutGain(None)));
        assert_eq!(next, Next::Decide);
        state
    }

    #[test]
    fn a_rejection_is_remembered_and_changes_no_model() {
        let state = after_rejection(&bench());
        let set = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<BTreeSet<String>>();
        assert_eq!(state.memory.tried.rejected, ["incidence_bias"]);
        assert_eq!(
            state.memory.tried.together,
            [set(&["incidence_bias"]), set(&["incidence_bias", "quadratic_depth"])]
        );
        assert_eq!(state.rounds[0].outcome, Some(RoundOutcome::NoHeldOutGain));
        assert!(names(&state).is_empty());
    }

    #[test]
    fn a_decision_made_under_one_model_does_not_outlive_it() {
        let bench = bench();
        let mut state = after_rejection(&bench);
        state.memory.hidden.push("thin_prism".to_owned());
        assert_eq!(state.apply(accepted(bench.state(&["range_offset"]))), Next::Examine);
        assert_eq!(state.memory.tried, Tried::default());
        assert_eq!((names(&state), state.memory.largest_share), (vec!["range_offset"], 0.25));
        // Images are the same under every model.
        assert_eq!(state.memory.hidden, ["thin_prism"]);
    }

    #[test]
    fn effects_that_are_taken_out_are_hidden_from_then_on() {
        let bench = bench();
        let mut state = after_rejection(&bench);
        let State { model, present, .. } = bench.state(&["range_offset"]);
        let effects = vec![PieceSpec::new("thin_prism")];
        let next = state.apply(Event::TakenOut(Box::new(TakenOut { model, present, effects: effects.clone() })));
        assert_eq!((next, names(&state)), (Next::Examine, vec!["range_offset"]));
        assert_eq!(state.memory.hidden, ["thin_prism"]);
        assert_eq!(state.memory.tried.rejected, ["incidence_bias"]);
        assert_eq!(state.rounds[0].outcome, Some(RoundOutcome::TakenOut { effects }));
    }

    #[test]
    fn a_refused_formula_leaves_model_and_memory() {
        let bench = bench();
        let mut state = after_rejection(&bench);
        let (tried, cost) = (state.memory.tried.clone(), state.present.fit.cost);
        let refused = Event::FormulaRefused { reason: "chance".to_owned(), together: None };
        assert_eq!(state.apply(refused), Next::GoOn);
        assert_eq!(state.findings.formula_refused.as_deref(), Some("chance"));
        assert_eq!(state.apply(Event::FormulaCompared(None)), Next::GoOn);
        assert!(state.memory.compared_with_formula);
        assert_eq!((state.memory.tried.clone(), state.present.fit.cost), (tried, cost));
        assert!(names(&state).is_empty() && state.findings.left_over.is_empty());
        assert_eq!(state.rounds[0].outcome, Some(RoundOutcome::NoHeldOutGain));
    }

    #[test]
    fn the_last_trial_says_whether_an_effect_is_possible() {
        let bench = bench();
        let mut state = bench.state(&[]);
        let gain = GainInterval { value: 1.0, low: -1.0, high: 3.0 };
        let possible = |name: &str| Some(Possible::new(PieceSpec::new(name), gain, 20));
        state.apply(rejected(&["range_offset"], Rejection::NoHeldOutGain(possible("range_offset"))));
        state.apply(rejected(&["radial_range"], Rejection::NoHeldOutGain(possible("radial_range"))));
        // A fit that fails says nothing.
        state.apply(rejected(&["radial_range"], Rejection::NotFitted("singular".to_owned())));
        assert_eq!(state.findings.possible.len(), 2);
        state.apply(rejected(&["range_offset"], Rejection::NoHeldOutGain(None)));
        let names: Vec<&str> = state.findings.possible.iter().map(|p| p.spec.name.as_str()).collect();
        assert_eq!(names, ["radial_range"]);
    }
}
