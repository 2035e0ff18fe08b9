//! Every call into OpenCV. Compiled only with the feature `opencv`.

mod context;
mod image;
pub(crate) mod sectors;
pub(crate) mod tags;
pub(crate) mod threads;
