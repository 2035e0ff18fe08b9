//! Joint analysis of the calibrations of many cameras of one type.
//!
//! Every calibration gives the parameters of one unit with their covariance, and the scores of the effects that its model lacks.
//! Together they tell what no single one can:
//!
//! | question | module |
//! |---|---|
//! | what units share and how they scatter: the random-effects model | [`random_effects`] |
//! | tests of both, corrected for their number | [`significance`] |
//! | effects that all units share, or that differ, also where no unit alone shows them | `effects` |
//! | which unit is unlike the others, and in what | [`outliers`], of its errors `errors` |
//! | whether an effect that was found in one unit repeats in others | `replication` |
//! | whether effects with constants of their own do the same to depth | `on_depth` |
//! | a prior for the next unit, and the record | [`mod@join`] |
//!
//! [`read_units`] reads calibrations, [`join()`] answers. The mathematics with its sources is in docs/fleets.md. Everything is
//! deterministic: nothing is resampled, and sums are taken in the order of the units.

mod conditions;
mod depth_effect;
mod effects;
mod error;
mod errors;
pub mod join;
mod on_depth;
pub mod outliers;
pub mod random_effects;
mod read;
mod replication;
mod scaled;
pub mod significance;
mod unit;

pub use conditions::Conditions;
pub use depth_effect::DepthEffect;
pub use error::{FEWEST_UNITS, FleetError};
pub use join::{FleetOptions, Joined, join};
pub use random_effects::{RandomEffects, UnitEstimate};
pub use read::read_units;
pub use unit::{EffectKey, Unit, UnitEffect, UnitParameter, UnitScores};
