//! Errors of the correction.

use depthcal_model::CameraError;
use thiserror::Error;

/// Reasons for which a camera cannot correct depth, or arguments do not fit the camera.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum CorrectorError {
    /// The camera has no pixels.
    #[error(
        "the camera's image size is {width}×{height} px: the calibration must state the width and height of its images"
    )]
    Empty {
        /// Width of the image, px.
        width: usize,
        /// Height, px.
        height: usize,
    },
    /// No pixel has a ray.
    #[error(
        "the camera's pinhole or lens maps no ray to any pixel (at pixel (0, 0): {source}): its parameters are \
         unusable; calibrate again"
    )]
    NoRay {
        /// Why pixel (0, 0) has no ray.
        source: CameraError,
    },
    /// An image has another size than the camera.
    #[error(
        "{what} has {}×{} px, but the calibration is for {}×{} px: use images of the calibrated resolution",
        found.0, found.1, expected.0, expected.1
    )]
    Size {
        /// Which image.
        what: &'static str,
        /// Its width and height, px.
        found: (usize, usize),
        /// Width and height of the camera, px.
        expected: (usize, usize),
    },
    /// A buffer has another length than the camera's number of pixels requires.
    #[error(
        "{what} has {found} values, but the calibrated resolution requires {expected}: use a buffer of that length"
    )]
    Length {
        /// Which buffer.
        what: &'static str,
        /// Its length.
        found: usize,
        /// The length that is required: one value per pixel, three for interleaved points.
        expected: usize,
    },
    /// The corrector was not told how uncertain its camera is.
    #[error(
        "the uncertainty of this camera's depth is unknown: the calibration has no noise of depth; calibrate with depth images"
    )]
    NoUncertainty,
    /// The depth unit is not a length.
    #[error("the depth unit is {unit_mm} mm per step: give a number above 0")]
    Unit {
        /// The unit, mm per step.
        unit_mm: f64,
    },
}
