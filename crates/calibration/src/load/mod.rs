//! From a dataset on disk to detected boards.

mod cache;
mod circle_diameter;
mod dataset;
mod declared_camera;
#[cfg(feature = "detect")]
mod detection;
mod error;
mod found;
mod given_markers;
mod given_markers_error;
mod in_memory;
mod marker_lists;
mod per_board;
mod same_frames;

pub use circle_diameter::MeasuredDiameter;
pub use dataset::{LoadOptions, Loaded, LoadedCamera, default_cache, load, load_with_markers};
pub use declared_camera::{DeclaredCameraError, declared_camera};
pub use error::LoadError;
pub use given_markers_error::GivenMarkersError;
pub use in_memory::{DatasetInMemory, FrameInMemory, declared_in_memory, load_from_memory};
pub use marker_lists::GivenMarkers;
