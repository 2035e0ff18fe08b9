//! The start of several cameras: each alone, and their places from shared views or, without images, from planes.

mod depth_camera_prior;
mod depth_camera_start;
mod known_extrinsics;
mod start;

pub(super) use depth_camera_prior::left_open;
pub(super) use known_extrinsics::compare_with_expected;
pub(super) use start::{Started, start};
