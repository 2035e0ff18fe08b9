//! Covariates of free functions.

use depthcal_model::{Context, Quantity};

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
    /// Distance of the ray from the optical axis on the normalised image plane, and inverse depth, both together.
    RadiusAndDepth,
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
    /// A quantity of the frame that the user records.
    Quantity(Quantity),
}

impl Along {
    /// Its value for an observation in a state of the depth hook, or of the board hook: one number, or two of a place in the
    /// image or on the board.
    pub(super) fn coordinates(self, state: &[f64], context: &Context) -> [f64; 2] {
        match self {
            Self::Pixel => context.pixel,
            Self::Column => [context.pixel[0], 0.0],
            Self::Row => [context.pixel[1], 0.0],
            Self::Depth => [state[2], 0.0],
            Self::RadiusAndDepth => [state[0].hypot(state[1]), state[2]],
            Self::Amplitude => [log_amplitude(context), 0.0],
            Self::Incidence => [state[3], 0.0],
            Self::Time => [context.time_s, 0.0],
            Self::Temperature => [context.temperature_c, 0.0],
            Self::Board => [state[0], state[1]],
            Self::Quantity(quantity) => [context.quantities.value(quantity), 0.0],
        }
    }

    /// Whether the covariate is the pixel's position, or a part of it: then a map over the image can correct the depth.
    pub fn is_of_the_pixel(self) -> bool {
        matches!(self, Along::Pixel | Along::Column | Along::Row)
    }
}

/// Logarithm of the infrared amplitude; finite for an amplitude of zero.
pub(super) fn log_amplitude(context: &Context) -> f64 {
    context.amplitude.max(1e-300).ln()
}
