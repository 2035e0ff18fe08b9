//! An effect that the loop has added to the declared model.

use depthcal_io::GainInterval;
use depthcal_model::Placement;

use super::evidence::Evidence;
use super::held_out::HeldOut;

/// An effect that the loop has added, or the free map.
#[derive(Clone)]
pub(super) struct AddedEffect {
    /// Its evidence in the round in which it was found, with the value of its constant as searched since.
    pub evidence: Evidence,
    /// Names of the effects that explained the residuals together, this one first.
    pub effects: Vec<String>,
    /// Effects that the captures cannot distinguish from it.
    pub indistinguishable: Vec<String>,
    /// Effects that only cameras of another technology have, and that explain a part of the same.
    pub of_other_technologies: Vec<String>,
    /// Its other places and forms that the captures cannot distinguish from the one it has.
    pub placements_not_told_apart: Vec<Placement>,
    /// p-value, corrected for the number of effects tested.
    pub p_value: f64,
    /// Held-out errors of the model with it and those before it.
    pub after: HeldOut,
    /// Fall of the error on left-out frames through it, given all others of the last model, per cent, see
    /// [`Gain::Certain`](super::held_out::Gain); `None` before that is known, and of a free map.
    pub gain_percent: Option<GainInterval>,
}

impl AddedEffect {
    /// An effect that alone explained the residuals, in the one place that it may have. `after` are the held-out errors with it,
    /// once they are known.
    pub fn alone(evidence: Evidence, p_value: f64, after: HeldOut) -> Self {
        Self {
            effects: vec![evidence.name.clone()],
            indistinguishable: Vec::new(),
            of_other_technologies: Vec::new(),
            placements_not_told_apart: Vec::new(),
            p_value,
            after,
            gain_percent: None,
            evidence,
        }
    }
}
