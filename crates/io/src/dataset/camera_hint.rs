//! Intrinsics declared by a dataset.

use serde::{Deserialize, Serialize};

/// Intrinsics from `[camera]` in `dataset.toml`: start values of a fit, or constants where `fixed`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CameraHint {
    /// Focal length in x, px.
    pub fx: f64,
    /// Focal length in y, px.
    pub fy: f64,
    /// Column of the principal point, px; the centre of the first pixel is 0.
    pub cx: f64,
    /// Row of the principal point, px; the centre of the first pixel is 0.
    pub cy: f64,
    /// Skew, px; 0 where the file has none.
    pub skew: f64,
    /// Brown–Conrady k1 k2 p1 p2 k3; 0 where the file has none.
    pub distortion: [f64; 5],
    /// Whether a fit holds these values constant; false where the file has no such field.
    pub fixed: bool,
}
