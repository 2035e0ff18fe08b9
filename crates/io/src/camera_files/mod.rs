//! Cameras in the files of other programs, read and written: OpenCV's FileStorage, ROS camera_info, Kalibr's camchain, mrcal's
//! .cameramodel, COLMAP's cameras.txt.
//!
//! All but COLMAP share depthcal's conventions: x right, y down, z forward, and the centre of the first pixel at (0, 0); COLMAP
//! has it at (0.5, 0.5). A lens that a format cannot hold is replaced by the nearest that it can, and the largest error in pixels
//! that this makes over the image is an [`ExportWarning`].

mod capability;
mod colmap;
mod error;
mod export_camera;
mod format;
mod intrinsics;
mod kalibr;
mod lens_form;
mod mrcal;
mod opencv;
mod outcome;
mod read;
mod ros;
#[cfg(test)]
mod tests;
mod text;
mod write;
mod yaml;

pub use error::{CameraFileError, ExportError};
pub use export_camera::ExportCamera;
pub use format::CameraFormat;
pub use intrinsics::{FileLens, Intrinsics};
pub use outcome::{Export, ExportWarning};
pub use read::{parse_camera, read_camera};
