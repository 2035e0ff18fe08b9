//! The rounds of the loop: tests, decision and outcome.

use depthcal_model::PieceSpec;

use super::decision::Decision;
use super::evidence::Evidence;
use super::examination::Examination;
use super::free_functions::Along;

/// A round of the loop.
#[derive(Debug, Clone)]
pub struct Round {
    /// The candidates by falling gain; those of the decision are places in this list.
    pub evidence: Vec<Evidence>,
    /// Cost of all frames, ½ Σ r².
    pub cost: f64,
    /// The decision.
    pub decision: Decision,
    /// Effects that the decision disregards.
    pub refuted: Vec<Refuted>,
    /// The outcome; `None` where nothing is missing.
    pub outcome: Option<RoundOutcome>,
}

/// An effect that a decision disregards.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Refuted {
    /// Its place in [`Round::evidence`].
    pub effect: usize,
    /// Why.
    pub because: Refutation,
}

/// Why a decision disregards an effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Refutation {
    /// It explains too little of what a free function of its covariate, in its place and form, explains.
    OwnFunction {
        /// The covariate.
        along: Along,
        /// Share that it explains of what both explain together.
        explained: f64,
    },
    /// It is one of the lens, and images alone do not show it.
    NotInImages,
}

/// The outcome of a decision.
#[derive(Debug, Clone, PartialEq)]
pub enum RoundOutcome {
    /// Effects are added.
    Added {
        /// Their specifications, the found one among them.
        effects: Vec<PieceSpec>,
        /// Effects of earlier rounds that these make unnecessary, and that are removed.
        removed: Vec<PieceSpec>,
    },
    /// Functions of what the residuals depend on are added, all together, whatever the decision.
    Explained {
        /// Their specifications, or those of the effects that they were named.
        effects: Vec<PieceSpec>,
        /// Effects of earlier rounds that these make unnecessary, and that are removed.
        removed: Vec<PieceSpec>,
    },
    /// The effect is not added: with it the errors on held-out frames are no smaller.
    NoHeldOutGain,
    /// The effect is not added: the model with it cannot be fitted.
    NotFitted {
        /// Why.
        error: String,
    },
    /// The effect is not added: the loop has reached its largest number of rounds.
    RoundLimit {
        /// Number of rounds.
        rounds: usize,
    },
    /// The effect is not added: too many effects before it reduced no error.
    RejectionLimit {
        /// Number of effects rejected since the last one was added.
        rejected: usize,
    },
    /// The structure that no named effect explains is reported.
    Reported,
    /// Effects of the lens that were added before are removed: something else is unexplained, and images alone do not show them.
    TakenOut {
        /// Their specifications.
        effects: Vec<PieceSpec>,
    },
    /// The structure that no named effect explains is corrected by a free map.
    FreeMapAdded {
        /// The form of the map.
        map: PieceSpec,
    },
    /// The evidence is too small: for effects to be tried, or for structure that no named effect explains to be reported.
    Negligible {
        /// Its merit over the cost.
        share_of_cost: f64,
        /// The least share that is tried or reported.
        least_share: f64,
    },
}

impl Round {
    /// An examination and the decision on it.
    pub(super) fn new(examination: &Examination, decision: Decision, refuted: Vec<Refuted>) -> Self {
        Self { evidence: examination.evidence.clone(), cost: examination.cost(), decision, refuted, outcome: None }
    }

    /// The effects that were tested, by falling gain.
    pub fn effects(&self) -> impl Iterator<Item = &Evidence> {
        self.evidence.iter().filter(|e| e.along.is_none())
    }

    /// The free functions that were tested, by falling gain.
    pub fn free_functions(&self) -> impl Iterator<Item = &Evidence> {
        self.evidence.iter().filter(|e| e.along.is_some())
    }

    /// Names of candidates, given by their places in [`Round::evidence`].
    pub fn names(&self, places: &[usize]) -> Vec<String> {
        places.iter().map(|i| self.evidence[*i].name.clone()).collect()
    }
}
