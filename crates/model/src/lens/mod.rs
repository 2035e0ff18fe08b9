//! Lens pieces: undistorted to distorted normalised coordinates.

mod brown_conrady;
mod focus_breathing;
mod rational_distortion;
mod thin_prism;
mod tilted_sensor;

pub use brown_conrady::BrownConrady;
pub use focus_breathing::FocusBreathing;
pub use rational_distortion::RationalDistortion;
pub use thin_prism::ThinPrism;
pub use tilted_sensor::TiltedSensor;
