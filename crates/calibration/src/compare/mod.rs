//! Comparison of depth models on equal terms: one solver, one protocol, and data that no fit has seen.
//!
//! Every variant (a depth model, a lens model, an estimator) is fitted to the training dataset and evaluated on the other
//! datasets; without others, on frames of the training dataset that each of several fits holds out. The calibration of camera
//! and lens from the images is the same for all variants and done once.

mod driver;
pub mod errors;
mod image_calibrations;
mod information_criteria;
mod learning_curve;
mod options;
mod ranking;
mod stability;
pub mod tables;
mod variants;
mod verdict;

pub use driver::compare;
pub use options::CompareOptions;
pub use variants::{Variant, subsets};
