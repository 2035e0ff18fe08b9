//! What free functions depend on.

use depthcal_model::Context;

/// The covariate of a free function.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Along {
    /// Pixel position, both coordinates together.
    Pixel,
    /// Image column.
    Column,
    /// Image row.
    Row,
    /// Inverse depth.
    Depth,
    /// Infrared amplitude, its logarithm.
    Amplitude,
    /// Angle of incidence, its cosine.
    Incidence,
    /// Time.
    Time,
    /// Temperature.
    Temperature,
    /// Position on the board: its shape.
    Board,
}

impl Along {
    /// Whether the covariate is the pixel's position, or a part of it: then a map over the image can correct the depth.
    pub fn is_of_the_pixel(self) -> bool {
        matches!(self, Along::Pixel | Along::Column | Along::Row)
    }
}

/// Logarithm of the infrared amplitude; finite for an amplitude of zero.
pub(super) fn log_amplitude(context: &Context) -> f64 {
    context.amplitude.max(1e-300).ln()
}
