//! Plane geometry shared by detection and refinement.

mod board_map;
mod homography;
mod local_map;

pub use board_map::BoardMap;
pub use homography::Homography;
pub(crate) use homography::Pair;
pub(crate) use local_map::LocalMap;
