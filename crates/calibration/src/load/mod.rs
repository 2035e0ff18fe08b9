//! From a dataset on disk to detected boards.

mod dataset;
#[cfg(feature = "detect")]
mod detection;
mod error;

pub use dataset::{LoadOptions, Loaded, declared_camera, default_cache, load};
pub use error::LoadError;
