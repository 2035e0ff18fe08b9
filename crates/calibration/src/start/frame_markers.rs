//! The markers of one frame, as the start values need them.

use crate::observe::MarkerObservation;

/// The markers of one frame, as the start values need them.
#[derive(Debug, Clone, Copy)]
pub struct FrameMarkers<'a> {
    /// Name for messages.
    pub name: &'a str,
    /// What was found.
    pub markers: &'a [MarkerObservation],
}
