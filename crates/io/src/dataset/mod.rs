//! Datasets: `dataset.toml`, the table of frames, and the files of every frame.

mod boards;
mod camera_hint;
mod candidate;
mod declaration;
mod error;
mod folder;
mod frame_table;
mod frames;
mod inside;
mod natural;
mod pairing;
mod rig;
mod rig_declaration;
mod section;
mod suggest;
mod text;
mod time_list;

pub use camera_hint::{CameraHint, IntrinsicNumbers};
pub use declaration::{DATASET_FILE, DatasetFile, DepthSection, FramesSection};
pub use error::DatasetError;
pub use folder::Dataset;
pub use frame_table::FrameMetadata;
pub use frames::Frame;
pub use pairing::{Pairing, Stray};
pub use rig::{RigDataset, RigMember};
pub use rig_declaration::{CameraSection, RigFile};
