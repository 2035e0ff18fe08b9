//! The part of the gain of functions that a name loses, and whether that is little.

use depthcal_io::GainInterval;
use depthcal_model::{Block, Covariate};
use tracing::info;

use super::bench::Fitted;
use crate::diagnose::discovery::Discovery;
use crate::judge::cross_validation::weighted_gain_percent;

/// Share of its gain that a function may lose to a name: names extrapolate, and close gaps.
const LOST: f64 = 0.03;
/// Share of that gain by which a name may gain more: one that gains much more explains something else. As much is lost at most
/// where it is certain that little is.
const MORE: f64 = 0.25;
/// Share of its gain that a function may lose to a name that explains most of it.
const REST: f64 = 0.3;
/// Width of a 95 % interval in standard errors.
const WIDTH: f64 = 3.92;

/// The gain of functions and the part of it that a name loses, per cent of the errors on left-out frames.
pub(super) struct Lost {
    whole: f64,
    lost: GainInterval,
}

/// The loss by a name of the gain of functions over `without`, the model that has neither.
pub(super) fn lost(without: &Fitted, functions: &Fitted, named: &Fitted) -> Option<Lost> {
    let gain = |before: &Fitted, after: &Fitted| {
        weighted_gain_percent(&before.held_out.evaluated, &after.held_out.evaluated, &functions.fit.noise.depth)
    };
    Some(Lost { whole: gain(without, functions)?.value, lost: gain(named, functions)? })
}

impl Lost {
    fn standard_error(&self) -> f64 {
        (self.lost.high - self.lost.low) / WIDTH
    }

    /// The name says nearly as much as the functions, or more.
    pub fn is_little(&self) -> bool {
        self.lost.value <= self.standard_error().max(LOST * self.whole)
    }

    /// It is certain that no large part is lost: where frames are few, a name that says nothing may lose no more than chance.
    pub fn is_no_large_part(&self) -> bool {
        self.lost.high <= MORE * self.whole
    }

    /// The name says much more than the functions.
    fn is_much_more(&self) -> bool {
        self.lost.value < -self.standard_error().max(MORE * self.whole)
    }
}

/// Whether a piece needs the covariates that a function needs, and these alone: it explains nothing else.
pub(super) fn has_covariates_of(block: &Block, function: &Discovery) -> bool {
    let of_function: Vec<Covariate> = function.effect.covariates().iter().filter_map(|c| c.needs()).collect();
    let of_piece = block.piece().map_or(&[][..], |piece| piece.needs());
    !of_piece.is_empty() && of_piece == of_function
}

/// The part of a function's gain that a name has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Says {
    Less,
    /// Less, but most of it.
    Most,
    AsMuch,
    /// It explains something else.
    MuchMore,
}

/// The part of a function's gain over the model `without` it that a name has. A name with the function's own covariates
/// (`is_own`) may have more: it describes the same better than a smooth function. Another one explains it only for certain.
pub(super) fn says(without: &Fitted, function: &Fitted, named: &Fitted, (name, is_own): (&str, bool)) -> Says {
    let Some(lost) = lost(without, function, named) else { return Says::Less };
    let is_little = lost.is_little() && (is_own || lost.is_no_large_part());
    let says = match (is_little, lost.is_much_more()) {
        (false, _) if lost.lost.value <= REST * lost.whole => Says::Most,
        (false, _) => Says::Less,
        (true, true) if !is_own => Says::MuchMore,
        (true, _) => Says::AsMuch,
    };
    let Lost { whole, lost: GainInterval { value, low, high } } = lost;
    info!("additive: {name} loses {value:.2} % ({low:.2} to {high:.2}) of the {whole:.2} % of its function: {says:?}");
    says
}
