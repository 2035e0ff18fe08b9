//! The markers of one frame: input of the start values.

use crate::observe::MarkerObservation;

/// The markers of one frame.
#[derive(Debug, Clone, Copy)]
pub struct FrameMarkers<'a> {
    /// Name of the frame, for messages.
    pub name: &'a str,
    /// The detected markers.
    pub markers: &'a [MarkerObservation],
}
