//! Writing a camera in any of the formats.

use super::error::ExportError;
use super::export_camera::ExportCamera;
use super::format::CameraFormat;
use super::outcome::Export;
use super::{colmap, kalibr, mrcal, opencv, ros};

impl ExportCamera {
    /// Writes the camera in `format`.
    ///
    /// # Errors
    /// [`ExportError::Value`] when a number is not finite, or size or focal length are not positive.
    pub fn export(&self, format: CameraFormat) -> Result<Export, ExportError> {
        self.check()?;
        Ok(match format {
            CameraFormat::OpenCv => opencv::write(self),
            CameraFormat::Ros => ros::write(self),
            CameraFormat::Kalibr => kalibr::write(self),
            CameraFormat::Mrcal => mrcal::write(self),
            CameraFormat::Colmap => colmap::write(self),
        })
    }
}
