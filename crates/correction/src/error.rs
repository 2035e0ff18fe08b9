//! Why depth cannot be corrected.

use depthcal_model::CameraError;
use thiserror::Error;

/// Why depth cannot be corrected.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum CorrectorError {
    /// The camera has no pixels.
    #[error("the camera's image has {width} × {height} px: give the size of its images")]
    Empty {
        /// Width of the image, px.
        width: usize,
        /// Height, px.
        height: usize,
    },
    /// No pixel has a ray.
    #[error("no pixel of the camera has a ray, so its pinhole or lens is not usable: {source}; calibrate again")]
    NoRay {
        /// What is wrong at the first pixel.
        source: CameraError,
    },
    /// An image has another size than the camera.
    #[error(
        "{what} has {}×{} px, but the calibration is for {}×{} px: give images of the calibrated resolution",
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
    /// A buffer does not hold one value per pixel.
    #[error("{what} has {found} values, but the camera has {expected} pixels")]
    Length {
        /// Which buffer.
        what: &'static str,
        /// Its length.
        found: usize,
        /// The number of pixels.
        expected: usize,
    },
    /// The depth unit is not a length.
    #[error("the depth unit is {unit_mm} mm per step: give a number above 0")]
    Unit {
        /// The unit, mm per step.
        unit_mm: f64,
    },
}
