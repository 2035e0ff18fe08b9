//! Refinement of markers by fitting a model of their appearance to the raw grey values.

mod circles;
pub(crate) mod clear;
mod corners;
mod crossing;
mod disc;
mod fit;
mod mapping;
mod marker;
mod pixels;

pub use circles::refine_circles;
pub(crate) use circles::sharpen_circles;
pub use corners::refine_corners;
pub use mapping::homography_mapping;
pub use marker::{RefineOptions, RefinedMarker};
