//! Recordings for the rerun viewer (`--rrd`): boards, camera, images, depth and clouds, frame by frame.
//!
//! | entity | what |
//! |---|---|
//! | `world` | the camera's frame (x right, y down, z forward), in metres |
//! | `world/camera` | pinhole with image plane; `image` below it, with dots `found` and `reprojected` |
//! | `world/board` | the board at this frame's pose: its `points` and `outline` |
//! | `world/poses` | outlines at the poses of all frames |
//! | `world/cloud` | board pixels as `measured` and `corrected`, coloured by their depth error |
//! | `depth` | the depth image as measured |
//! | `error` | errors of every frame as curves |
//! | `frame`, `about` | name of the frame; what the recording shows |
//!
//! The one timeline is `frame`, which counts over all captures. The depth image is not below the camera: the viewer's
//! pinhole has no lens, and would show a cloud of its own that is wrong by it. Pixel centres are at integers here and at
//! halves there.

mod cloud;
mod file;
mod scene;
#[cfg(test)]
mod tests;
mod write;

pub use write::{RecordedCapture, write};
