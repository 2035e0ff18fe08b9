//! Intrinsics that a dataset declares.

use serde::{Deserialize, Serialize};

/// Intrinsics from `[camera]` in `dataset.toml`: start values, or, where `fixed`, values to hold.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CameraHint {
    /// Focal length in x, px.
    pub fx: f64,
    /// Focal length in y, px.
    pub fy: f64,
    /// Principal point, px from the centre of the first pixel.
    pub cx: f64,
    /// Principal point, px from the centre of the first pixel.
    pub cy: f64,
    /// Skew, px; 0 where the file has none.
    pub skew: f64,
    /// Brown–Conrady k1 k2 p1 p2 k3; 0 where the file has none.
    pub distortion: [f64; 5],
    /// Whether a fit holds these values; false where the file does not say.
    pub fixed: bool,
}
