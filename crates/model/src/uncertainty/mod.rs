//! How uncertain a camera and the depth that it corrects are.

mod camera;
mod depth;
mod noise;
mod support;

pub use camera::{STEP, UncertainCamera};
pub use depth::{DepthStdDev, UncertainDepth};
pub use noise::DepthNoise;
pub use support::Support;
