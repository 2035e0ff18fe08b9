//! Rules for the rounds of a calibration.

use super::error::CalibrateError;
use crate::adjust::adjustment::AdjustedCamera;
use crate::adjust::state::CameraState;
use crate::observe::SampledFrame;

/// Rounds of adjustment and noise estimation.
pub(super) const ROUNDS: usize = 4;
/// Relative change of a standard deviation below which the noise has settled.
pub(super) const NOISE_SETTLED: f64 = 0.01;

/// Relative change of the noise below which a large field is not adjusted again.
const NOISE_SETTLED_BY_NODE: f64 = 0.1;

/// How degrees of freedom are counted where variances are estimated from residuals.
pub(super) enum Freedom {
    /// From the covariance of the parameters: n − tr(J Σ Jᵀ).
    FromCovariance,
    /// By counting this many parameters of large fields, whose covariance is out of reach. Errs towards more noise.
    Counted(usize),
}

/// How often was adjusted.
#[derive(Debug, Clone, Copy)]
pub(super) struct Attempt {
    /// Number of the round, from 1.
    pub round: usize,
    /// Repairs before this one.
    pub repairs: usize,
}

/// A repair of the only camera after an adjustment, given how often was adjusted; true where the round has to
/// begin anew. It is asked for in the first rounds: later ones hardly change the state.
pub(super) type Repair<'a, F> =
    &'a dyn Fn(Attempt, &mut CameraState<F>, &AdjustedCamera) -> Result<bool, CalibrateError>;

/// Rules for the rounds of a calibration.
pub(super) struct Rules<'a, F> {
    /// Whether depth samples take part.
    pub with_depth: bool,
    /// How degrees of freedom are counted.
    pub freedom: Freedom,
    /// Rounds up to this one drop outlying samples; the last round keeps them, so that the result belongs to them.
    pub last_to_drop: usize,
    /// Rounds after which the result is taken as it is.
    pub most_rounds: usize,
    /// Relative change of the depth noise below which it has settled.
    pub depth_noise_settled: f64,
    /// Whether the smoothness of fields is chosen from the data.
    pub chooses_smoothness: bool,
    /// Mends the state first in each round; `None` where there is nothing to mend.
    pub repair: Option<Repair<'a, F>>,
}

/// The rules of a joint adjustment in which the nodes of fields, so many, are variables of their own. Their smoothness is known.
pub(super) fn rules_by_node<'a>(nodes: usize) -> Rules<'a, SampledFrame> {
    Rules {
        freedom: Freedom::Counted(nodes),
        last_to_drop: 1,
        depth_noise_settled: NOISE_SETTLED_BY_NODE,
        chooses_smoothness: false,
        ..joint_rules()
    }
}

/// The rules of a joint adjustment whose covariance can be had.
pub(super) fn joint_rules<'a>() -> Rules<'a, SampledFrame> {
    Rules {
        with_depth: true,
        freedom: Freedom::FromCovariance,
        last_to_drop: ROUNDS - 1,
        most_rounds: ROUNDS,
        depth_noise_settled: 2.0 * NOISE_SETTLED,
        chooses_smoothness: true,
        repair: None,
    }
}
