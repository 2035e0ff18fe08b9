//! Cameras in the files of other programs, read and written; docs/lenses.md has the table of programs.
//!
//! A text becomes a document (`document`: YAML, JSON, XML, `ost.ini`), in which `programs` recognises each program's cameras by
//! their keys. `keys` has the spellings of quantities and `lens_words` the names of lens models that programs share.
//!
//! All but COLMAP and nerf share depthcal's conventions: x right, y down, z forward, and the centre of the first pixel at (0, 0);
//! these two have it at (0.5, 0.5). A lens that a format cannot hold is replaced by the nearest that it can, and the largest
//! error in pixels that this makes over the image is an [`ExportWarning`]. A lens that is not recognised is an error.

mod azure_kinect;
mod camodocal;
mod capability;
mod colmap;
mod document;
mod error;
mod export_camera;
mod format;
mod intrinsics;
mod kalibr;
mod keys;
mod lens_form;
mod lens_words;
mod matrix;
mod modified_lens;
mod mrcal;
mod named;
mod nerf;
mod node;
mod open3d;
mod opencv;
mod orb_slam;
mod orbbec;
mod ost;
mod outcome;
mod programs;
mod read;
mod realsense;
mod ros;
#[cfg(test)]
mod tests;
mod text;
mod write;
mod xml;
mod yaml;

pub use error::{CameraFileError, ExportError};
pub use export_camera::ExportCamera;
pub use format::CameraFormat;
pub use intrinsics::{FileLens, Intrinsics};
pub use outcome::{Export, ExportWarning};
pub use read::{parse_camera, read_camera};
