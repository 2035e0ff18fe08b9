use serde::{Deserialize, Serialize};

use super::quantity::Quantities;
use crate::frame_covariates::StrayLight;

/// An observation's covariates that are not part of the chain's state. They are constant under differentiation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Context {
    /// Pixel of the depth image, px.
    pub pixel: [f64; 2],
    /// Infrared amplitude at the pixel, in steps of the image; NaN where unknown.
    pub amplitude: f64,
    /// Mean infrared amplitude around the pixel, weighted by a Gaussian of [`SURROUND_PX`](crate::SURROUND_PX); NaN where
    /// unknown.
    #[serde(default = "unknown")]
    pub surround: f64,
    /// Slope of the logarithm of that mean along u and v, 1/px; NaN where unknown.
    #[serde(default = "unknown_slope")]
    pub slope: [f64; 2],
    /// Light of the whole scene that the lens spreads over the pixel.
    #[serde(default)]
    pub stray: StrayLight,
    /// Time of the frame since the first, s; 0 where unknown.
    pub time_s: f64,
    /// Temperature of the frame, °C; NaN where unknown.
    pub temperature_c: f64,
    /// Further quantities of the frame.
    #[serde(default)]
    pub quantities: Quantities,
}

fn unknown() -> f64 {
    f64::NAN
}

fn unknown_slope() -> [f64; 2] {
    [f64::NAN; 2]
}

impl Default for Context {
    fn default() -> Self {
        Self {
            pixel: [0.0; 2],
            amplitude: f64::NAN,
            surround: f64::NAN,
            slope: [f64::NAN; 2],
            stray: StrayLight::UNKNOWN,
            time_s: 0.0,
            temperature_c: f64::NAN,
            quantities: Quantities::NONE,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Observations that were written before these covariates were there.
    #[test]
    fn covariates_that_a_file_lacks_are_unknown() {
        let text = r#"{"pixel": [3.0, 4.0], "amplitude": 700.0, "time_s": 2.0, "temperature_c": 25.0}"#;
        let context: Context = serde_json::from_str(text).unwrap();
        assert!(context.surround.is_nan() && context.slope.iter().all(|s| s.is_nan()) && !context.stray.is_known());
        assert_eq!((context.pixel, context.amplitude), ([3.0, 4.0], 700.0));
    }
}
