//! `diff.json`: how far two calibrations are apart, against both uncertainties.

use serde::{Deserialize, Serialize};

use super::result_file::result_file;
use crate::file::{read_json, write_json};

/// Result of `depthcal diff`: differences are second minus first.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Difference {
    /// Name of the first calibration, as it was given.
    pub first: String,
    /// Name of the second.
    pub second: String,
    /// Number of frames of one dataset to which both were fitted: their noise is then common, and the standard deviations of the
    /// difference, which take it as independent, are too large.
    pub common_frames: usize,
    /// Level of every test.
    pub level: f64,
    /// The cameras that both have.
    pub cameras: Vec<CameraDifference>,
    /// Names of cameras that only one of them has.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub not_compared: Vec<String>,
}

result_file!(Difference, "diff.json", read_json, write_json);

/// A camera of both calibrations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct CameraDifference {
    /// Its name; `camera` where it has none.
    pub name: String,
    /// Width of its images, px.
    pub width: usize,
    /// Height, px.
    pub height: usize,
    /// The camera in the first calibration.
    pub first: DifferenceSide,
    /// The camera in the second.
    pub second: DifferenceSide,
    /// Columns of the grid over the image: cell i of all lists below is at u = (i mod `columns`) (`width` − 1) / (`columns` − 1).
    pub columns: usize,
    /// Rows of the grid, likewise.
    pub rows: usize,
    /// Difference of projection: one entry for all distances, or one per distance where the lens depends on it.
    pub projection: Vec<ProjectionDifference>,
    /// Difference of corrected depth at every distance; empty where neither corrects depth.
    pub depth: Vec<DepthDifference>,
    /// Difference of the extrinsics; absent for the reference.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub extrinsics: Option<ExtrinsicsDifference>,
    /// Parameters that both have.
    pub parameters: Vec<ParameterDifference>,
}

/// A camera in one of two calibrations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct DifferenceSide {
    /// Names of its pieces, without pinhole and board.
    pub pieces: Vec<String>,
    /// Number of fitted frames; 0 of a camera file of another program.
    pub frames: usize,
    /// Whether its covariance is known; it is taken as exact otherwise.
    pub has_covariance: bool,
    /// Whether it corrects depth.
    pub corrects_depth: bool,
    /// Nearest and farthest distance of the fitted boards, mm, where frames are known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub covered_mm: Option<[f64; 2]>,
}

/// Size of a difference over the image, against what both uncertainties make of it.
///
/// Cells whose standard deviation is more than four times the median are left out: there a calibration extrapolates.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct DifferenceSize {
    /// Root mean square over the cells of the grid.
    pub rms: f64,
    /// Root mean square that both uncertainties alone would give on average; absent where neither has a covariance.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub expected_rms: Option<f64>,
    /// p-value of the difference being one of noise: of the mean square, whose distribution has the first three moments that the
    /// covariances give. Absent with `expected_rms`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub p_value: Option<f64>,
    /// Whether the p-value is below the level: they differ by more than their uncertainty.
    pub differs: bool,
    /// Where the difference is the largest multiple of its standard deviation; without covariances, where it is largest.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub clearest: Option<ClearestDifference>,
}

/// The cell in which a difference is clearest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct ClearestDifference {
    /// Column, px.
    pub u: f64,
    /// Row, px.
    pub v: f64,
    /// Difference: of depth with its sign, mm; of projection its length, px.
    pub difference: f64,
    /// Its standard deviation.
    pub std_dev: f64,
}

/// Where the second camera sees what the first sees, after the rotation between their rays was removed.
///
/// The rotation is the one that maps the rays of the first camera to those of the second best, in weighted least squares over the
/// grid with the inverse variances of the cells as weights: two calibrations do not have a common frame beyond that.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct ProjectionDifference {
    /// Distance, mm; absent where it holds for all distances.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distance_mm: Option<f64>,
    /// The rotation that was removed, as a rotation vector, rad.
    pub rotation_rad: [f64; 3],
    /// Size over the image, px.
    pub size: DifferenceSize,
    /// Difference along u in every cell, px; null where a lens has no ray or pixel.
    pub du_px: Vec<Option<f64>>,
    /// Along v.
    pub dv_px: Vec<Option<f64>>,
    /// Standard deviation of both together in every cell, px.
    pub std_dev_px: Vec<Option<f64>>,
}

/// Difference of the corrected depth of pixels that measure the same.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct DepthDifference {
    /// Measured depth, mm.
    pub distance_mm: f64,
    /// Size over the image, mm.
    pub size: DifferenceSize,
    /// Difference in every cell, mm; null where depth cannot be corrected.
    pub difference_mm: Vec<Option<f64>>,
    /// Its standard deviation, mm.
    pub std_dev_mm: Vec<Option<f64>>,
}

/// Difference of a camera's extrinsics (R, t), rig to camera.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct ExtrinsicsDifference {
    /// ω of R₂ = R₁ Exp(ω), rad.
    pub rotation_rad: [f64; 3],
    /// t₂ − t₁, mm.
    pub translation_mm: [f64; 3],
    /// Standard deviations of ω and of the translation; absent where neither calibration has a covariance of them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub std_dev: Option<[f64; 6]>,
    /// p-value of all six being zero; absent with `std_dev`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub p_value: Option<f64>,
}

/// A parameter that both calibrations have.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct ParameterDifference {
    /// Name, `piece.parameter`.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Value in the first calibration.
    pub first: f64,
    /// Value in the second.
    pub second: f64,
    /// Standard deviation of the difference; absent where neither calibration has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub std_dev: Option<f64>,
}

impl CameraDifference {
    /// Pixel of a cell of the grid.
    pub fn pixel(&self, cell: usize) -> [f64; 2] {
        grid_pixel([self.width, self.height], [self.columns, self.rows], cell)
    }

    /// Distances that the boards of both calibrations cover, mm; `None` where they have none in common or are not known.
    pub fn covered_by_both_mm(&self) -> Option<[f64; 2]> {
        let both = match (self.first.covered_mm, self.second.covered_mm) {
            (Some(a), Some(b)) => [a[0].max(b[0]), a[1].min(b[1])],
            (Some(one), None) | (None, Some(one)) => one,
            (None, None) => return None,
        };
        (both[0] < both[1]).then_some(both)
    }
}

/// Pixel of a cell of a grid over an image, of which the outermost cells lie on the outermost pixels.
pub fn grid_pixel(size: [usize; 2], [columns, rows]: [usize; 2], cell: usize) -> [f64; 2] {
    let along = |i: usize, n: usize, pixels: usize| (pixels as f64 - 1.0) * i as f64 / (n as f64 - 1.0).max(1.0);
    [along(cell % columns, columns, size[0]), along(cell / columns, rows, size[1])]
}
