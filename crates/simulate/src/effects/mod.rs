//! Effects: systematic errors of camera or board, each applied where it arises.
//!
//! Every effect has one size, in mm or px. Its other properties (a period, a direction, a time constant) have nominal
//! values and vary between individual cameras; see [`Simulation::unit`](crate::Simulation::unit).
//!
//! Depth sizes called *rms* are the root mean square of the effect on depth, before the projective distortion, over the
//! **reference volume**: frontal surfaces at depths uniform from 400 to 1200 mm, over all pixels of the image.

mod beyond;
mod board;
mod drift;
mod effect;
mod given;
mod info;
mod install;
mod lens;
mod light;
mod nature;
mod place;
mod range;
mod registration;
mod scattering;
#[cfg(test)]
mod size_tests;
mod sizing;
mod table;
mod triangulation;

pub use effect::Effect;
pub use given::{GivenEffect, Observation};
pub use info::{EffectInfo, Parameters};
pub use install::EffectTruth;
pub(crate) use install::install;
pub use place::{Form, Place};
pub use table::{catalogue, of_whole_frames, uncatalogued};
