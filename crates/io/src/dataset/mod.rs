//! Datasets: `dataset.toml`, the table of frames, and the files of every frame.

mod board;
mod boards;
mod camera_hint;
mod candidate;
mod common_names;
mod declaration;
mod error;
mod extrinsics;
mod folder;
mod frame;
mod frame_table;
mod frames;
mod globs;
mod inside;
mod natural;
mod pairing;
mod rows;
mod section;
mod suggest;
mod tabled;
mod text;
mod time_list;
mod written;

pub use camera_hint::{CameraHint, IntrinsicNumbers};
pub use declaration::{CAMERA, CameraSection, DATASET_FILE, DatasetFile};
pub use error::DatasetError;
pub use folder::{Dataset, DatasetCamera};
pub use frame::Frame;
pub use frame_table::FrameMetadata;
pub use pairing::{Pairing, Stray};
