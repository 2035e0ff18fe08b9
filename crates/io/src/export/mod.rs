//! Calibrations in the formats of other programs.
//!
//! All of them share depthcal's conventions: x right, y down, z forward, the centre of the first pixel at (0, 0), and
//! Brown–Conrady distortion in the order k1 k2 p1 p2 k3. What a format cannot represent is reported as an
//! [`ExportWarning`].

mod camera;
mod error;
mod format;
mod kalibr;
mod mrcal;
mod opencv;
mod outcome;
mod ros;
mod text;

pub use camera::ExportCamera;
pub use error::ExportError;
pub use format::ExportFormat;
pub use kalibr::kalibr_camchain;
pub use mrcal::mrcal_cameramodel;
pub use opencv::opencv_yaml;
pub use outcome::{Export, ExportWarning};
pub use ros::ros_camera_info;
