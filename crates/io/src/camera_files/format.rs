//! The formats of other programs.

use std::str::FromStr;

use super::error::ExportError;

/// A format of another program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CameraFormat {
    /// OpenCV's FileStorage, YAML.
    OpenCv,
    /// ROS camera_info, YAML.
    Ros,
    /// Kalibr's camchain, YAML.
    Kalibr,
    /// mrcal's .cameramodel.
    Mrcal,
    /// COLMAP's cameras.txt.
    Colmap,
}

impl CameraFormat {
    /// All formats.
    pub const ALL: [Self; 5] = [Self::OpenCv, Self::Ros, Self::Kalibr, Self::Mrcal, Self::Colmap];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::OpenCv => "opencv",
            Self::Ros => "ros",
            Self::Kalibr => "kalibr",
            Self::Mrcal => "mrcal",
            Self::Colmap => "colmap",
        }
    }
}

impl FromStr for CameraFormat {
    type Err = ExportError;

    fn from_str(name: &str) -> Result<Self, ExportError> {
        let unknown = || ExportError::UnknownFormat { name: name.to_owned() };
        Self::ALL.into_iter().find(|format| format.name() == name).ok_or_else(unknown)
    }
}
