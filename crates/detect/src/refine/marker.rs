//! Refined markers, and the options of refinement.

use nalgebra::Matrix2;
use serde::{Deserialize, Serialize};

/// A marker after refinement.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RefinedMarker {
    /// Index in the order of [`Target::point`](depthcal_model::target::Target::point).
    pub index: usize,
    /// Image [u, v] of the marker's defined point, px.
    pub pixel: [f64; 2],
    /// Standard deviation of one coordinate of `pixel`, px, estimated from the scatter of the grey values about the
    /// model. It does not include errors that neighbouring pixels share, such as an uneven print.
    pub std_px: f64,
    /// Standard deviation of the grey values about the model, divided by the contrast of the marker.
    pub relative_noise: f64,
    /// Standard deviation of the Gaussian blur of the marker's edge, px.
    pub blur_px: f64,
    /// Contrast between print and paper, grey values of the image.
    pub contrast: f64,
    /// Fitted over declared radius, for dots; 1 for other markers.
    pub radius_ratio: f64,
}

/// How markers are refined.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RefineOptions {
    /// Largest number of Levenberg–Marquardt iterations per marker.
    pub iterations: usize,
    /// Prior standard deviation of the printed dots' radius, relative to the declared radius; 0 holds it fixed.
    pub radius_sigma: f64,
    /// Radius of the neighbourhood in which a chessboard's crossing is fitted, relative to the distance to the next
    /// crossing.
    pub corner_reach: f64,
    /// Largest such radius, px; over longer distances the lens bends the edges.
    pub max_corner_reach_px: f64,
}

impl Default for RefineOptions {
    fn default() -> Self {
        RefineOptions { iterations: 30, radius_sigma: 0.1, corner_reach: 0.5, max_corner_reach_px: 10.0 }
    }
}

/// Standard deviation of one coordinate, from the covariance of both.
pub(crate) fn standard_deviation(covariance: &Matrix2<f64>) -> f64 {
    (covariance.trace() / 2.0).max(0.0).sqrt()
}
