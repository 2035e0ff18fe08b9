//! Quantities that a correction depends on besides depth and pixel.

use depthcal_model::{MOST_QUANTITIES, Quantity};

/// Quantities that a correction depends on besides depth and pixel. Those that a frame must bring are given in
/// [`FrameContext`](crate::FrameContext).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Needs {
    /// The time of the frame.
    pub time: bool,
    /// The temperature of the frame.
    pub temperature: bool,
    /// Further quantities of the frame, by their names; the first of these places.
    pub quantities: [Option<Quantity>; MOST_QUANTITIES],
    /// The infrared amplitude: of the pixel, of those around it for [`Needs::surroundings`], of all pixels for
    /// [`Needs::stray_light`].
    pub amplitude: bool,
    /// The infrared amplitude around the pixel. It is computed from that of the frame.
    pub surroundings: bool,
    /// The light of the whole frame. It is computed from its depth and its infrared amplitude.
    pub stray_light: bool,
    /// The angle of incidence at the pixel. It is computed from the depth around the pixel; the frame need not bring
    /// it.
    pub incidence: bool,
}
