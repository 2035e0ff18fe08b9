//! A camera given to a command: a calibration, or a file of another program.

use std::path::{Path, PathBuf};

use depthcal_io::{Calibration, Intrinsics, read_camera};
use depthcal_model::{Camera, Register};

use super::common::read_calibration;
use super::failure::{Failure, input};

/// A camera from a file.
#[derive(Debug)]
pub(super) enum GivenCamera {
    /// A calibration.json, and its camera.
    Calibration(Box<Calibration>, Box<Camera>),
    /// A file of another program: pinhole and lens.
    Intrinsics(PathBuf, Intrinsics),
}

impl GivenCamera {
    /// Reads a file: a calibration where its name ends with `.json`, else a file of another program.
    pub(super) fn read(path: &Path, register: &Register) -> Result<Self, Failure> {
        if path.extension().is_none_or(|extension| extension == "json") {
            let (calibration, camera) = read_calibration(path, register)?;
            return Ok(Self::Calibration(Box::new(calibration), Box::new(camera)));
        }
        Ok(Self::Intrinsics(path.to_owned(), read_camera(path).map_err(input)?))
    }

    /// Size of its images, px, where its file has one.
    pub(super) fn size(&self) -> Option<[usize; 2]> {
        match self {
            Self::Calibration(_, camera) => Some([camera.width, camera.height]),
            Self::Intrinsics(_, intrinsics) => intrinsics.size,
        }
    }

    /// The camera, with images of this size (px) where its file has none.
    pub(super) fn camera(&self, size: [usize; 2], register: &Register) -> Result<Camera, Failure> {
        match self {
            Self::Calibration(_, camera) => Ok((**camera).clone()),
            Self::Intrinsics(path, intrinsics) => {
                intrinsics.camera(size, register).map_err(|e| Failure::Input(format!("{}: {e}", path.display())))
            }
        }
    }

    /// The record, of a calibration.
    pub(super) fn record(&self) -> Option<&Calibration> {
        match self {
            Self::Calibration(calibration, _) => Some(calibration),
            Self::Intrinsics(..) => None,
        }
    }

    /// Digest of the dataset that the camera was fitted to, where that is known.
    pub(super) fn fitted_digest(&self) -> Option<&str> {
        self.record().map(|calibration| calibration.dataset.digest.as_str())
    }
}
