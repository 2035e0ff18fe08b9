//! Structure in the residuals of the last model that no effect explains.

use super::discovery::CovariateSet;
use super::evidence::Evidence;
use super::frame_planes::FramePlane;
use super::free_functions::Along;
use super::pure_error::{PureError, Shared};
use super::thresholds::Thresholds;

/// Structure in the residuals that no named effect explains.
#[derive(Debug, Clone, PartialEq)]
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
    /// A function of two covariates together gains on held-out frames, though none of one does.
    Together {
        /// Names of the covariates, as in formulas.
        covariates: Vec<String>,
        /// Share of the squared residuals of left-out frames that it explains.
        share_of_cost: f64,
    },
    /// Frames deviate each by a plane of its own: something changes from frame to frame that no covariate describes.
    FramePlanes {
        /// Share of the frames that deviate significantly.
        share: f64,
        /// Root mean square of the planes over all frames, mm of depth.
        rms_mm: f64,
    },
    /// Frames share residuals at the same values of a covariate.
    Shared(Shared),
}

impl LeftOver {
    /// A free function of which named effects explain the share `explained`; `None` for the evidence of an effect.
    pub(super) fn free_function(evidence: &Evidence, explained: f64) -> Option<Self> {
        let size_mm = evidence.expected_size_mm;
        evidence.along.map(|along| Self::FreeFunction { along, size_mm, explained })
    }

    /// A function of two covariates.
    pub(super) fn together(set: &CovariateSet) -> Self {
        let covariates = set.covariates.iter().map(|c| c.name().to_owned()).collect();
        Self::Together { covariates, share_of_cost: set.share_of_cost }
    }

    /// The largest residual that frames share, where it is large enough to matter and no free function of the same covariate is
    /// `known`. Only the largest: a residual that depends on one covariate depends on others in part.
    pub(super) fn shared(pure_error: &PureError, known: &[Self], thresholds: &Thresholds) -> Option<Self> {
        let is_known = |along: &[Along]| {
            known.iter().any(|k| matches!(k, Self::FreeFunction { along: other, .. } if along == [*other]))
        };
        let largest = pure_error.shared.first().filter(|s| !is_known(&s.along))?;
        let least = thresholds.least_shared_share.sqrt() * pure_error.residual_mm;
        (largest.size_mm > least).then(|| Self::Shared(largest.clone()))
    }

    /// The planes of all frames, of which the share `share` is significant.
    pub(super) fn frame_planes(planes: &[FramePlane], share: f64) -> Self {
        let rms_mm = (planes.iter().map(|p| p.rms_mm * p.rms_mm).sum::<f64>() / planes.len().max(1) as f64).sqrt();
        Self::FramePlanes { share, rms_mm }
    }
}
