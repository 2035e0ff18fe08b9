//! Datasets: `dataset.toml`, the table of frames, and the files of every frame.

mod camera_hint;
mod declaration;
mod error;
mod folder;
mod frame_table;
mod natural;
mod section;
mod suggest;

pub use camera_hint::CameraHint;
pub use declaration::{DATASET_FILE, DatasetFile, DepthSection, FramesSection};
pub use error::DatasetError;
pub use folder::{Dataset, Frame};
pub use frame_table::FrameMetadata;
