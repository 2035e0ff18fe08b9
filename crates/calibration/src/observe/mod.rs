//! Measurements: frames at every stage, depth samples, their noise, and the pixels that show the board.

mod board_heights;
pub mod board_motion;
pub mod board_pixels;
pub mod board_plane;
pub mod board_region;
mod camera_frames;
mod capture;
pub mod depth_sampling;
pub mod extrinsics_drift;
pub(crate) mod frame_light;
pub(crate) mod gross_markers;
mod kept_light;
pub mod marker_depth;
pub mod neighbourhood;
pub mod noise;
pub mod outliers;
pub(crate) mod pixel_covariates;
pub mod pixel_rays;
mod placed_camera;
pub(crate) mod projected_markers;
mod stages;
pub mod stored;
pub(crate) mod wrong_markers;

pub use camera_frames::CameraFrames;
pub use capture::{CameraCapture, Capture};
pub use depthcal_io::{DroppedFrame, MarkerObservation};
pub use extrinsics_drift::{PlaceDrift, Taken};
pub use kept_light::FrameLight;
pub use pixel_rays::PixelRays;
pub use placed_camera::PlacedCamera;
pub use stages::{
    AdjustableFrame, DepthPixel, DepthSample, DetectedFrame, EvaluableFrame, MeasuredDepth, OpenFrame, PosedFrame,
    RawFrame, SampledFrame,
};
pub use stored::Stored;
