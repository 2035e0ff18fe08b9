//! The light of a frame, kept with the frame.

use std::sync::Arc;

use depthcal_model::{FrameCovariates, Modulation};

/// The light of a frame, and the modulation frequencies for which it was computed.
#[derive(Debug, Clone)]
pub struct FrameLight {
    pub(super) modulation: Modulation,
    /// `None` where the frame has no image or no depth.
    pub(super) covariates: Option<Arc<FrameCovariates>>,
}
