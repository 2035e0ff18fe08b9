//! What the models of a rig's cameras lack: the loop of one camera on each camera with depth, then all cameras jointly again.

mod alone;
mod drift_test;
mod driver;

pub use alone::{alone, examined, with_projected_markers};
pub use drift_test::{DriftLeftOut, DriftTest, drift_tests};
pub use driver::{CameraDiagnosis, RigDiagnoseOptions, RigDiagnosis, diagnose_rig};
