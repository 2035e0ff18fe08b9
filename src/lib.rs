//! depthcal calibrates depth cameras.

pub mod adjustment;
pub mod board_region;
pub mod calibrate;
pub mod capture;
mod cells;
pub mod cli;
pub mod compare;
pub mod corrector;
pub mod cross_validation;
pub mod depth_sampling;
#[cfg(feature = "detect")]
mod detection;
pub mod diagnose;
pub mod estimators;
pub mod evaluate;
pub mod factors;
pub mod marker_depth;
pub mod noise;
pub mod observations;
mod progress;
pub mod record;
pub mod report;
#[cfg(feature = "rerun")]
pub mod rerun;
pub mod roughness;
pub mod simulated;
pub mod smoothness;
pub mod start;
