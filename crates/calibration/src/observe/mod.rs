//! Measurements: frames at every stage, depth samples, their noise, and the pixels that show the board.

pub mod board_region;
mod capture;
pub mod depth_sampling;
pub mod marker_depth;
mod neighbourhood;
pub mod noise;
mod stages;

pub use capture::{Capture, DroppedFrame};
pub use neighbourhood::Neighbourhood;
pub use stages::{
    AdjustableFrame, DepthPixel, DepthSample, DetectedFrame, MarkerObservation, MeasuredDepth, PosedFrame, RawFrame,
    SampledFrame,
};
