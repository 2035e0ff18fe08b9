//! From the captures of all cameras to a calibrated rig.

mod contradiction;
mod depth_camera_prior;
mod depth_camera_start;
mod driver;
mod fitted;
mod known_extrinsics;
mod options;
mod start;

pub(crate) use contradiction::check_evidence;
pub use driver::calibrate_rig;
pub(crate) use driver::fit_rig;
pub use fitted::{CameraFit, RigCalibrated, TimeOffset};
pub use options::{EffectOf, HeldOf, RigOptions};
