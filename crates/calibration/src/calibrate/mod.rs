//! From detected boards to a calibrated depth camera.

mod checked_sample;
mod depth_scale;
mod domain;
mod driver;
mod error;
mod explanation;
mod fitted;
mod folds;
mod foreign_depth;
mod frame_checks;
#[cfg(test)]
mod frame_planes_tests;
mod frame_scatter;
#[cfg(test)]
mod hard_frames_tests;
mod held;
mod image;
mod joint;
mod large_fields;
mod lens_choice;
mod lens_comparison;
mod lens_order;
mod marker_estimators;
mod model_blocks;
mod options;
mod parameter_names;
mod readjust;
mod residuals;
pub mod rig;
mod rig_contradiction;
mod rounds;
mod rules;
mod sampled;
mod settle;
mod settled_camera;
mod undetermined;
#[cfg(test)]
mod wide_lens_tests;

pub use depth_scale::{ImplausibleScale, PLAUSIBLE_SCALE_DEVIATION, implausible_scale};
pub(crate) use driver::light_of_samples;
pub use driver::{calibrate, calibrate_depth, calibrate_keeping_samples, prepare_depth};
pub use error::CalibrateError;
pub use fitted::Calibrated;
pub use folds::check_invertible;
pub use foreign_depth::ForeignDepth;
pub use frame_scatter::with_frame_scatter;
pub use held::{HeldError, HeldParameter};
pub use image::calibrate_image;
pub(crate) use image::calibrate_image_or_cause;
pub use lens_comparison::AUTO;
pub use lens_order::{LensCandidate, LensChoice, LensOrder, lens_named};
pub use model_blocks::image_blocks;
pub use options::{CalibrateOptions, Estimator};
pub use parameter_names::parameter_names;
pub use readjust::{has_fields, readjust};
pub use rig_contradiction::RigContradiction;
pub use sampled::sampled_under;
pub use undetermined::UndeterminedModel;
