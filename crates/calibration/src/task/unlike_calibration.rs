//! Datasets that are not of a calibration's cameras.

use thiserror::Error;

/// Why a calibration cannot be evaluated on a dataset.
#[derive(Debug, Error)]
pub enum UnlikeCalibration {
    /// Images have another size than the camera was calibrated for.
    #[error(
        "{path}: its images are {} × {} px, but the calibration is for {} × {} px",
        found[0], found[1], expected[0], expected[1]
    )]
    Size {
        /// The dataset.
        path: String,
        /// Width and height of its images, px.
        found: [usize; 2],
        /// Those of the calibration.
        expected: [usize; 2],
    },
    /// Images of one camera of several have another size than it was calibrated for.
    #[error(
        "{path}: images of camera {camera} are {} × {} px, but its calibration is for {} × {} px",
        found[0], found[1], expected[0], expected[1]
    )]
    CameraSize {
        /// The dataset.
        path: String,
        /// The camera.
        camera: String,
        /// Width and height of its images, px.
        found: [usize; 2],
        /// Those of its calibration.
        expected: [usize; 2],
    },
    /// The dataset has no camera of the calibration.
    #[error(
        "{path}: none of its cameras ({has}) is in the calibration ({calibrated}): give the sections [cameras.NAME] the names of the \
         calibration"
    )]
    Names {
        /// The dataset.
        path: String,
        /// Names of its cameras.
        has: String,
        /// Names of the calibrated cameras.
        calibrated: String,
    },
}
