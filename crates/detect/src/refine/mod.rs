//! Refinement of markers by fitting a model of their appearance to the raw grey values.

mod circles;
pub(crate) mod clear;
mod corners;
mod crossing;
mod diameter;
mod disc;
mod fit;
mod mapping;
mod marker;
pub(crate) mod pixels;

pub use circles::refine_circles;
pub(crate) use circles::sharpen_circles;
pub(crate) use corners::fit_corner;
pub use corners::refine_corners;
pub use diameter::{CircleDiameter, measure_circle_diameter};
pub use mapping::homography_mapping;
pub(crate) use marker::standard_deviation;
pub use marker::{RefineOptions, RefinedMarker};
