//! Intrinsics and lens declared by a dataset.

use serde::Serialize;

/// `[camera]` in `dataset.toml`: intrinsics, in numbers or from a file of another program, and the lens model of a fit. At least
/// one of them is given.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct CameraHint {
    /// Pinhole and Brown–Conrady coefficients in numbers.
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    pub numbers: Option<IntrinsicNumbers>,
    /// File of another program, relative to the dataset's folder; `FILE#NAME` for one of several cameras.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub intrinsics: Option<String>,
    /// Lens model that is fitted, as given to `--lens`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lens: Option<String>,
    /// Whether a fit holds the intrinsics constant; false where the file has no such field.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub fixed: bool,
}

/// Intrinsics in numbers.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct IntrinsicNumbers {
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
    /// OpenCV's coefficients in their order, 4, 5, 8, 12 or 14 of them; with `lens = "kannala-brandt"` the four of a fisheye
    /// lens. Empty where the file has none.
    pub distortion: Vec<f64>,
}
