//! The infrared light: an emitter beside the camera, falling off with the squared range and towards the image's
//! corners, and the exposure.

use serde::{Deserialize, Serialize};

/// How the image's brightness is set.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "mode", rename_all = "kebab-case")]
pub enum Exposure {
    /// Every frame so that the white of the board has this share of full scale in its middle, as far as the gain
    /// goes: boards farther away than 1.1 m become darker.
    Auto {
        /// Share of full scale.
        white: f64,
    },
    /// The same for all frames, as raw infrared images have it.
    Fixed {
        /// Share of full scale that the white of a frontal board has on the optical axis at 1 m.
        white_at_1m: f64,
    },
}

/// Light and exposure of one frame.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Light {
    gain: f64,
}

impl Light {
    /// For a frame whose board has its middle at `middle` (camera frame, mm) and is as white as `bright`.
    pub fn new(exposure: Exposure, bright: f64, middle: [f64; 3]) -> Self {
        match exposure {
            Exposure::Auto { white } => {
                let at = |[x, y, z]: [f64; 3]| irradiance([x / z, y / z], z);
                let weakest = at([0.0, 0.0, 1100.0]);
                Self { gain: white / (bright * at(middle).max(weakest)) }
            }
            Exposure::Fixed { white_at_1m } => Self { gain: white_at_1m / bright },
        }
    }

    /// Signal of a surface at depth `z` on `ray`, as a share of full scale, not yet clipped.
    pub fn signal(&self, albedo: f64, cosine: f64, ray: [f64; 2], z: f64) -> f64 {
        self.gain * albedo * cosine * irradiance(ray, z)
    }
}

/// Light that reaches a surface at depth `z` on `ray` and from there the pixel, relative to 1 m on the axis. A lens'
/// image of a lit surface falls off with the fourth power of the cosine; with the squared range instead of the squared
/// depth, two of the four powers are the light's longer way, the other two what the emitter does not make up for.
fn irradiance([x, y]: [f64; 2], z: f64) -> f64 {
    let secant2 = 1.0 + x * x + y * y;
    (1000.0 / z).powi(2) / (secant2 * secant2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exposure_holds_the_white_until_the_gain_ends() {
        let exposure = Exposure::Auto { white: 0.6 };
        let white = |z: f64| Light::new(exposure, 0.8, [0.0, 0.0, z]).signal(0.8, 1.0, [0.0, 0.0], z);
        assert!((white(300.0) - 0.6).abs() < 1e-12);
        assert!((white(1000.0) - 0.6).abs() < 1e-12);
        assert!((white(1500.0) - 0.6 * (1.1f64 / 1.5).powi(2)).abs() < 1e-12);
        let fixed = Light::new(Exposure::Fixed { white_at_1m: 0.1 }, 0.8, [0.0, 0.0, 1.0]);
        assert!((fixed.signal(0.8, 1.0, [0.0, 0.0], 500.0) - 0.4).abs() < 1e-12);
    }
}
