//! Start values from the markers alone: homographies, Zhang's closed form for the pinhole, poses.
//!
//! Captures that do not determine a camera are refused with a [`StartError`] that names what is missing.

pub mod depth_only;
mod error;
mod frame_markers;
mod homography;
mod lens_models;
mod pose;
mod pose_precision;
mod start_values;
pub mod views;
mod wide_angle;
mod zhang;

pub use error::{FEWEST_FRAMES, FEWEST_MARKERS, PARALLEL_DEG, StartError};
pub use frame_markers::FrameMarkers;
pub use homography::{HomographyFit, fit_homography, homography};
pub use lens_models::{LENS_MODELS, LensModel, lens_block, lens_models};
pub(crate) use pose::mirrored_pose;
pub use pose::{PoseFit, estimate_pose, local_poses, refine_pose};
pub use pose_precision::{MOST_UNCERTAIN_DEPTH, PoseDoubt, pose_doubt};
pub(crate) use pose_precision::{PoseInformation, doubt_between};
#[cfg(feature = "detect")]
pub(crate) use start_values::is_wide;
pub use start_values::{start_camera, start_values};
pub use zhang::{check_tilts, pinhole_from_homographies};
