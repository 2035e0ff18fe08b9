//! Structure in the residuals of the last model that no effect explains.

use super::evidence::Evidence;
use super::frame_planes::FramePlane;
use super::free_functions::Along;

/// Structure in the residuals that no named effect explains.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LeftOver {
    /// A free function gains on held-out frames.
    FreeFunction {
        /// Its covariate.
        along: Along,
        /// Root mean square of what it takes up, mm of depth.
        size_mm: f64,
        /// Share of it that the best named effects explain.
        explained: f64,
    },
    /// Frames deviate each by a plane of its own: something changes from frame to frame that no covariate describes.
    FramePlanes {
        /// Share of the frames that deviate significantly.
        share: f64,
        /// Root mean square of the planes over all frames, mm of depth.
        rms_mm: f64,
    },
}

impl LeftOver {
    /// A free function of which named effects explain the share `explained`; `None` for the evidence of an effect.
    pub(super) fn free_function(evidence: &Evidence, explained: f64) -> Option<Self> {
        let size_mm = evidence.expected_size_mm;
        evidence.along.map(|along| Self::FreeFunction { along, size_mm, explained })
    }

    /// The planes of all frames, of which the share `share` is significant.
    pub(super) fn frame_planes(planes: &[FramePlane], share: f64) -> Self {
        let rms_mm = (planes.iter().map(|p| p.rms_mm * p.rms_mm).sum::<f64>() / planes.len().max(1) as f64).sqrt();
        Self::FramePlanes { share, rms_mm }
    }
}
