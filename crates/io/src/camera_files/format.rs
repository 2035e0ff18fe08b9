//! The formats of other programs.

use std::str::FromStr;

use super::error::ExportError;

/// A format of another program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CameraFormat {
    /// OpenCV's FileStorage, YAML.
    OpenCv,
    /// OpenCV's FileStorage, XML.
    OpenCvXml,
    /// OpenCV's FileStorage, JSON.
    OpenCvJson,
    /// ROS camera_info, YAML.
    Ros,
    /// `ost.ini` of ROS' cameracalibrator.
    Ost,
    /// Kalibr's camchain, YAML.
    Kalibr,
    /// mrcal's .cameramodel.
    Mrcal,
    /// COLMAP's cameras.txt.
    Colmap,
    /// Open3D's PinholeCameraIntrinsic, JSON.
    Open3d,
    /// camodocal's YAML, as VINS reads it.
    Camodocal,
    /// ORB-SLAM 3's settings, YAML.
    OrbSlam3,
    /// transforms.json of instant-ngp and nerfstudio.
    Nerf,
    /// RealSense's intrinsics, JSON.
    RealSense,
}

impl CameraFormat {
    /// All formats.
    pub const ALL: [Self; 13] = [
        Self::OpenCv,
        Self::OpenCvXml,
        Self::OpenCvJson,
        Self::Ros,
        Self::Ost,
        Self::Kalibr,
        Self::Mrcal,
        Self::Colmap,
        Self::Open3d,
        Self::Camodocal,
        Self::OrbSlam3,
        Self::Nerf,
        Self::RealSense,
    ];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        self.names().0
    }

    /// Name of a file as is usual in the format.
    pub fn file_name(self) -> &'static str {
        self.names().1
    }

    fn names(self) -> (&'static str, &'static str) {
        match self {
            Self::OpenCv => ("opencv", "camera.yml"),
            Self::OpenCvXml => ("opencv-xml", "camera.xml"),
            Self::OpenCvJson => ("opencv-json", "camera.json"),
            Self::Ros => ("ros", "camera_info.yaml"),
            Self::Ost => ("ost", "ost.ini"),
            Self::Kalibr => ("kalibr", "camchain.yaml"),
            Self::Mrcal => ("mrcal", "camera.cameramodel"),
            Self::Colmap => ("colmap", "cameras.txt"),
            Self::Open3d => ("open3d", "intrinsic.json"),
            Self::Camodocal => ("camodocal", "camera_camodocal.yaml"),
            Self::OrbSlam3 => ("orb-slam3", "orb_slam3.yaml"),
            Self::Nerf => ("nerf", "transforms.json"),
            Self::RealSense => ("realsense", "intrinsics.json"),
        }
    }
}

impl FromStr for CameraFormat {
    type Err = ExportError;

    fn from_str(name: &str) -> Result<Self, ExportError> {
        let unknown =
            || ExportError::UnknownFormat { name: name.to_owned(), known: Self::ALL.map(Self::name).join(", ") };
        Self::ALL.into_iter().find(|format| format.name() == name).ok_or_else(unknown)
    }
}
