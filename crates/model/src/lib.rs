//! The measurement model of depthcal: boards, poses, lenses, pinholes and depth distortions as composable pieces.

pub mod target;

pub use target::{Pattern, Target};
