//! From detected boards to a calibrated depth camera.

mod domain;
mod driver;
mod error;
mod fitted;
mod folds;
mod image;
mod joint;
mod large_fields;
mod marker_estimators;
mod options;
mod readjust;
mod residuals;
mod settle;

pub use driver::{calibrate, calibrate_depth, calibrate_keeping_samples};
pub use error::CalibrateError;
pub use fitted::Calibrated;
pub use image::calibrate_image;
pub use options::{CalibrateOptions, Estimator};
pub use readjust::readjust;
