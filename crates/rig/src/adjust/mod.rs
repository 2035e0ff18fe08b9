//! The joint adjustment of a rig: factors, variables, their uncertainty.

mod adjustment;
mod factors;

pub use adjustment::{Adjusted, RigAdjustment};
pub use factors::{CameraVariables, Observations, RigBatch, RigGroup};
