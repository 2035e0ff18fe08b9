//! The formats, and the export to one of them.

use std::str::FromStr;

use super::camera::ExportCamera;
use super::error::ExportError;
use super::kalibr::kalibr_camchain;
use super::mrcal::mrcal_cameramodel;
use super::opencv::opencv_yaml;
use super::outcome::Export;
use super::ros::ros_camera_info;

/// A format of another program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ExportFormat {
    /// OpenCV's FileStorage, YAML.
    OpenCv,
    /// ROS camera_info, YAML.
    Ros,
    /// Kalibr's camchain, YAML.
    Kalibr,
    /// mrcal's .cameramodel.
    Mrcal,
}

impl FromStr for ExportFormat {
    type Err = ExportError;

    fn from_str(name: &str) -> Result<Self, ExportError> {
        match name {
            "opencv" => Ok(ExportFormat::OpenCv),
            "ros" => Ok(ExportFormat::Ros),
            "kalibr" => Ok(ExportFormat::Kalibr),
            "mrcal" => Ok(ExportFormat::Mrcal),
            _ => Err(ExportError::UnknownFormat { name: name.to_owned() }),
        }
    }
}

impl ExportCamera {
    /// Writes the camera in `format`.
    ///
    /// # Errors
    /// [`ExportError::Value`] when a number is not finite, or size or focal length are not positive.
    pub fn export(&self, format: ExportFormat) -> Result<Export, ExportError> {
        match format {
            ExportFormat::OpenCv => opencv_yaml(self),
            ExportFormat::Ros => ros_camera_info(self),
            ExportFormat::Kalibr => kalibr_camchain(self),
            ExportFormat::Mrcal => mrcal_cameramodel(self),
        }
    }
}

#[cfg(test)]
mod tests;
