//! The thesis' three estimators of D, with camera, lens and poses given by the images: linear least squares, iteratively
//! reweighted least squares, and nonlinear least squares on distances in space. The joint adjustment is the fourth.

mod error;
mod linear;
mod marker_points;
mod nonlinear;

pub use error::EstimatorError;
pub use linear::{irls, linear};
pub use marker_points::{MarkerPoint, marker_points};
pub use nonlinear::nonlinear;
