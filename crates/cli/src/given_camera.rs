//! A camera given to a command: a calibration, or a file of another program.

use std::path::{Path, PathBuf};

use depthcal_calibration::observe::PlacedCamera;
use depthcal_calibration::rig_record::unnamed_camera;
use depthcal_io::{Calibration, Intrinsics, read_camera};
use depthcal_model::Register;

use super::common::read_cameras;
use super::failure::{Failure, input};

/// A camera from a file.
#[derive(Debug)]
pub(super) enum GivenCamera {
    /// A calibration.json.
    Calibration(PathBuf, Box<Calibration>),
    /// A file of another program: pinhole and lens.
    Intrinsics(PathBuf, Intrinsics),
}

impl GivenCamera {
    /// Reads a file: a calibration where its name ends with `.json`, else a file of another program.
    pub(super) fn read(path: &Path) -> Result<Self, Failure> {
        if path.extension().is_none_or(|extension| extension == "json") {
            return Ok(Self::Calibration(path.to_owned(), Box::new(Calibration::read(path).map_err(input)?)));
        }
        Ok(Self::Intrinsics(path.to_owned(), read_camera(path).map_err(input)?))
    }

    /// Size of its images, px, where its file has one.
    pub(super) fn size(&self) -> Option<[usize; 2]> {
        match self {
            Self::Calibration(_, calibration) => Some([calibration.camera.width, calibration.camera.height]),
            Self::Intrinsics(_, intrinsics) => intrinsics.size,
        }
    }

    /// The cameras, of which the first is the reference; a camera of another program has images of this size (px) where its file
    /// has none.
    pub(super) fn cameras(&self, size: [usize; 2], register: &Register) -> Result<Vec<PlacedCamera>, Failure> {
        match self {
            Self::Calibration(path, calibration) => read_cameras(path, calibration, register),
            Self::Intrinsics(path, intrinsics) => {
                let camera = intrinsics.camera(size, register);
                Ok(vec![unnamed_camera(camera.map_err(|e| Failure::Input(format!("{}: {e}", path.display())))?)])
            }
        }
    }

    /// The record, of a calibration.
    pub(super) fn record(&self) -> Option<&Calibration> {
        match self {
            Self::Calibration(_, calibration) => Some(calibration),
            Self::Intrinsics(..) => None,
        }
    }
}
