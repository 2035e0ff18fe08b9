//! Covariates that a frame determines beyond the pixel: the amplitude around it, and the light of the scene that the lens spreads
//! over all pixels.
//!
//! Everything here works on slices, row by row, and takes the range of a pixel from a function, so that calibration and
//! correction compute the same numbers from images of any type. A frame costs one pass over its pixels ([`Scene::row`]) and a sum
//! over some hundred blocks ([`Scene::spread`]).

mod block;
mod covariates;
mod modulation;
mod phase;
mod scene;
mod spread;
mod stray;
mod surroundings;
mod window;

pub use block::{BLOCK_PX, BlockSum};
pub use covariates::FrameCovariates;
pub use modulation::{FREQUENCIES, KINECT_V2_MHZ, LIGHT_MM_PER_S, Modulation};
pub use phase::{phasor, turns_per_mm};
pub use scene::Scene;
pub use spread::{SPREAD_PX, SceneLight};
pub use stray::{Phasors, StrayLight};
pub use surroundings::{SURROUND_PX, Surroundings, mean_and_slope};
pub use window::{NEAR_PX, NEAR_REACH, NEAR_WEIGHTS, OWN_REACH, own_and_near};
