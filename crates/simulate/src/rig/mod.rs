//! Several cameras on one rigid body that capture the same board.

mod camera;
mod dataset;
mod drift;
mod simulation;
mod truth;
mod usual;
mod waved;

pub use camera::{RigCamera, Streams};
pub use drift::Drift;
pub use simulation::RigSimulation;
pub use truth::{RigCameraTruth, RigPoints, RigTruth};
pub use waved::Waved;
