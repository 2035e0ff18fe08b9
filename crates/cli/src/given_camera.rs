//! A camera given to a command: a calibration, or a file of another program.

use std::path::{Path, PathBuf};

use depthcal_calibration::observe::PlacedCamera;
use depthcal_calibration::rig_record::unnamed_camera;
use depthcal_io::{Calibration, CameraFileError, Intrinsics, read_camera};
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
    /// Reads a file: a calibration where it has depthcal's `format`, else a file of another program. A file that is neither is
    /// judged as a calibration where it is called as one.
    pub(super) fn read(path: &Path) -> Result<Self, Failure> {
        let calibration = || Ok(Self::Calibration(path.to_owned(), Box::new(Calibration::read(path).map_err(input)?)));
        if is_of_depthcal(path) {
            return calibration();
        }
        let is_called_so =
            path.extension().is_none() || path.file_name().is_some_and(|name| name == "calibration.json");
        match read_camera(path) {
            Ok(intrinsics) => Ok(Self::Intrinsics(path.to_owned(), intrinsics)),
            Err(
                CameraFileError::Read { .. } | CameraFileError::UnknownFormat { .. } | CameraFileError::Syntax { .. },
            ) if is_called_so => calibration(),
            Err(error) => Err(input(error)),
        }
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

/// Whether a file is JSON with a `format` of depthcal's.
fn is_of_depthcal(path: &Path) -> bool {
    let json = std::fs::read(path).ok().and_then(|text| serde_json::from_slice::<serde_json::Value>(&text).ok());
    json.is_some_and(|json| json["format"].as_str().is_some_and(|format| format.starts_with("depthcal")))
}
