//! Start values without a guess from the user: homographies, Zhang's closed form, poses.
//!
//! Sets of captures that cannot determine a camera end in a [`StartError`] that says what is missing.

mod error;
mod frame_markers;
mod homography;
mod pose;
mod start_values;
mod zhang;

pub use error::{FEWEST_FRAMES, FEWEST_MARKERS, PARALLEL_DEG, StartError};
pub use frame_markers::FrameMarkers;
pub use homography::homography;
pub use pose::{PoseFit, estimate_pose, refine_pose};
pub use start_values::start_values;
pub use zhang::{check_tilts, pinhole_from_homographies};
