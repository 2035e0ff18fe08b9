//! Why calibrations cannot be joined.

use std::path::PathBuf;

use depthcal_io::FileError;
use thiserror::Error;

/// Fewest units: of two no scatter can be told from an outlier.
pub const FEWEST_UNITS: usize = 3;

/// Why calibrations cannot be joined.
#[derive(Debug, Error)]
pub enum FleetError {
    /// A file is at fault.
    #[error(transparent)]
    File(#[from] FileError),
    /// There is nothing at a path.
    #[error(
        "{}: there is neither a calibration.json nor a folder with some: give calibrations, or folders of results of `depthcal calibrate`",
        path.display()
    )]
    NoCalibration {
        /// The path.
        path: PathBuf,
    },
    /// Scores lie next to a calibration that they do not belong to.
    #[error("{}: belongs to another fit than {}: calibrate again into this folder", scores.display(), calibration.display())]
    ScoresOfAnother {
        /// The scores.
        scores: PathBuf,
        /// The calibration.
        calibration: PathBuf,
    },
    /// Too few calibrations fit together.
    #[error(
        "{found} calibrations have the same image size and parameters with a covariance, {needed} are needed{reasons}"
    )]
    TooFew {
        /// Calibrations that fit together.
        found: usize,
        /// Fewest.
        needed: usize,
        /// Those that were left out, each with the reason, in words; empty or beginning with a colon.
        reasons: String,
    },
    /// The random-effects model cannot be fitted.
    #[error(
        "the covariances of the calibrations are not positive definite: calibrate with more frames, or hold what these do not determine"
    )]
    NotPositiveDefinite,
}
