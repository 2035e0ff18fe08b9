//! Undistorted images and depth images: those of an ideal pinhole camera in the same place.
//!
//! An output pixel has a ray by the pinhole alone; the camera's pinhole and lens tell at which pixel the camera saw
//! that ray. Depth is z, which does not depend on the direction of the optical ray through the image, so that depth
//! values move but do not change.

mod means;
mod nearest;
mod segments;
mod to_pinhole;

pub use to_pinhole::{Remap, Texel};
