//! The quantities on which a residual may depend.

use depthcal_model::Quantity;
use serde::{Deserialize, Serialize};

/// The covariate of a free function: the quantity on which a diagnosis lets the residuals depend.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DiagnosisCovariate {
    /// Pixel position, column and row jointly.
    Pixel,
    /// Column of the image.
    Column,
    /// Row of the image.
    Row,
    /// Inverse depth.
    Depth,
    /// Distance of the pixel from the optical axis, and inverse depth, jointly.
    RadiusAndDepth,
    /// Logarithm of the infrared amplitude.
    Amplitude,
    /// Infrared amplitude around the pixel.
    Surroundings,
    /// Infrared amplitude and depth of the whole frame.
    StrayLight,
    /// Cosine of the angle of incidence.
    Incidence,
    /// Time of the frame.
    Time,
    /// Temperature of the camera.
    Temperature,
    /// Position on the board.
    Board,
    /// A further quantity of the frame: the name of its column in `frames.csv`.
    Quantity(#[schemars(with = "String")] Quantity),
}
