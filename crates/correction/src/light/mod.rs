//! The light of a frame that the lens spreads over all pixels, for pieces that depend on it
//! ([`depthcal_model::frame_covariates`]).

mod frame_light;
mod own_and_near;

pub(crate) use frame_light::{FrameLight, MeasuredDepth};
