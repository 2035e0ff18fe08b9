//! Writing a camera in any of the formats.

use super::error::ExportError;
use super::export_camera::ExportCamera;
use super::format::CameraFormat;
use super::outcome::Export;
use super::{camodocal, colmap, kalibr, mrcal, nerf, open3d, opencv, orb_slam, ost, realsense, ros};

impl ExportCamera {
    /// Writes the camera in `format`.
    ///
    /// # Errors
    /// [`ExportError::Value`] when a number is not finite, or size or focal length are not positive.
    pub fn export(&self, format: CameraFormat) -> Result<Export, ExportError> {
        self.check()?;
        Ok(match format {
            CameraFormat::OpenCv => opencv::write(self),
            CameraFormat::OpenCvXml => opencv::write_xml(self),
            CameraFormat::OpenCvJson => opencv::write_json(self),
            CameraFormat::Ost => ost::write(self),
            CameraFormat::Open3d => open3d::write(self),
            CameraFormat::Camodocal => camodocal::write(self),
            CameraFormat::OrbSlam3 => orb_slam::write(self),
            CameraFormat::Nerf => nerf::write(self),
            CameraFormat::RealSense => realsense::write(self),
            CameraFormat::Ros => ros::write(self),
            CameraFormat::Kalibr => kalibr::write(self),
            CameraFormat::Mrcal => mrcal::write(self),
            CameraFormat::Colmap => colmap::write(self),
        })
    }
}
