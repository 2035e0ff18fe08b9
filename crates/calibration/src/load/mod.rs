//! From a dataset on disk to detected boards.

mod circle_diameter;
mod dataset;
#[cfg(feature = "detect")]
mod detection;
mod error;
mod found;

pub use circle_diameter::MeasuredDiameter;
pub use dataset::{LoadOptions, Loaded, declared_camera, default_cache, load};
pub use error::LoadError;
