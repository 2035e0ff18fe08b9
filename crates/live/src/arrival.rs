//! A frame that has arrived.

use depthcal_io::{DepthFrame, FrameMetadata, GrayImage};

/// A frame that has arrived.
#[derive(Debug, Clone, PartialEq)]
pub struct Arrival {
    /// Name of its file or its number, for messages.
    pub name: String,
    /// The image.
    pub image: GrayImage,
    /// The depth image on the same pixel grid.
    pub depth: Option<DepthFrame>,
    /// Millimetres per unit of depth; given where there is depth.
    pub unit_mm: Option<f64>,
    /// Time and temperature.
    pub metadata: FrameMetadata,
    /// Whether frames follow each other so quickly that a board that moves shows in their differences.
    pub is_video: bool,
}
