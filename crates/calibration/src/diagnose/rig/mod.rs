//! Diagnosis of a rig: the loop of one camera on each camera with depth, then all cameras jointly again.

mod alone;
mod drift_test;
mod driver;
mod joint_search;
mod left_out;
mod trial;

pub use alone::examined;
pub use drift_test::{DriftTest, drift_tests};
pub(super) use driver::diagnose_rig;
pub use trial::EffectInRig;
