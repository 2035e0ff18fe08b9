//! A camera given to a task: a calibration, or a file of another program.

use std::path::{Path, PathBuf};

use depthcal_io::{Calibration, CameraFileError, Intrinsics, is_of_depthcal, read_camera};
use depthcal_model::Register;

use super::error::TaskError;
use crate::camera_record::RecordError;
use crate::camera_record::{cameras_from_record, unnamed_camera};
use crate::observe::PlacedCamera;

/// A camera from a file.
#[derive(Debug, Clone)]
pub enum GivenCamera {
    /// A calibration.json.
    Calibration(PathBuf, Box<Calibration>),
    /// A file of another program: pinhole and lens.
    Intrinsics(PathBuf, Intrinsics),
}

impl GivenCamera {
    /// Reads a file: a calibration where it has depthcal's `format`, else a file of another program. A file that is neither is
    /// judged as a calibration where it is called as one.
    ///
    /// # Errors
    ///
    /// [`TaskError::File`], [`TaskError::CameraFile`].
    pub fn read(path: &Path) -> Result<Self, TaskError> {
        let calibration = || Ok(Self::Calibration(path.to_owned(), Box::new(Calibration::read(path)?)));
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
            Err(error) => Err(TaskError::CameraFile(error)),
        }
    }

    /// Size of its images, px, where its file has one.
    pub fn size(&self) -> Option<[usize; 2]> {
        match self {
            Self::Calibration(_, calibration) => Some([calibration.camera.width, calibration.camera.height]),
            Self::Intrinsics(_, intrinsics) => intrinsics.size,
        }
    }

    /// The cameras, of which the first is the reference; a camera of another program has images of this size (px) where its file
    /// has none.
    ///
    /// # Errors
    ///
    /// [`TaskError::GivenCamera`] where a piece is not known here.
    pub fn cameras(&self, size: [usize; 2], register: &Register) -> Result<Vec<PlacedCamera>, TaskError> {
        let in_file = |path: &Path, error: RecordError| TaskError::GivenCamera {
            file: path.display().to_string(),
            error: Box::new(error),
        };
        match self {
            Self::Calibration(path, calibration) => {
                cameras_from_record(calibration, register).map_err(|error| in_file(path, error))
            }
            Self::Intrinsics(path, intrinsics) => {
                let camera = intrinsics.camera(size, register).map_err(|error| in_file(path, error.into()))?;
                Ok(vec![unnamed_camera(camera)])
            }
        }
    }

    /// The record, of a calibration.
    pub fn record(&self) -> Option<&Calibration> {
        match self {
            Self::Calibration(_, calibration) => Some(calibration),
            Self::Intrinsics(..) => None,
        }
    }
}
