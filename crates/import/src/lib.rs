//! Recordings as datasets: ROS 2 bags (MCAP, db3), ROS 1 bags, Matroska files of the Azure Kinect and its successors, and folders
//! of TUM RGB-D, Stray Scanner and Record3D.
//!
//! [`import`] reads a recording, chooses the streams of an image and of the depth on its pixel grid, picks frames that show the
//! board sharply, at rest and in different places, and writes them with a `dataset.toml`. A recording is read as a stream,
//! message by message; memory does not grow with its length, but for some numbers per image.
//!
//! # Features
//! `detect` (default) searches the board in the images. Without it frames are picked by sharpness, rest and difference alone.

mod azure;
mod camera_info;
mod compressed_depth;
mod dataset;
mod error;
mod fields;
mod guess;
mod import;
mod info_message;
mod message;
mod packed;
mod pairing;
mod pick;
mod picture;
mod recording;
mod score;
mod spread;
mod transforms;

pub use camera_info::CameraInfo;
pub use dataset::Imported;
pub use error::{ImportError, Span};
pub use import::{ImportOptions, import};
pub use pairing::Pairing;
pub use recording::StreamInfo;
