//! Infrared illumination by an emitter next to the camera, which falls off with the squared range and towards the
//! image's corners; light of the room; and the exposure.

use serde::{Deserialize, Serialize};

/// The exposure of the infrared images.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "mode", rename_all = "kebab-case")]
pub enum Exposure {
    /// Set for every frame such that the board's white, in its middle, has a given share of full scale. The gain is
    /// limited: boards farther away than 1.1 m are darker.
    Auto {
        /// Share of full scale.
        white: f64,
    },
    /// One exposure for all frames, as in raw infrared images.
    Fixed {
        /// Signal of the board's white, frontal on the optical axis at 1 m, share of full scale.
        white_at_1m: f64,
    },
    /// Light of the room, as colour cameras use it: the board's white has the same signal at every distance.
    Room {
        /// Signal of the board's white in the middle of the image, share of full scale.
        white: f64,
    },
}

/// Light and exposure of one frame.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Light {
    gain: f64,
    /// Whether it comes from the room instead of the camera's emitter.
    of_room: bool,
}

impl Light {
    /// Light of a frame whose board has its middle at `middle` (camera frame, mm) and whose white has reflectance
    /// `bright`.
    pub fn new(exposure: Exposure, bright: f64, middle: [f64; 3]) -> Self {
        match exposure {
            Exposure::Auto { white } => {
                let light_at = |[x, y, z]: [f64; 3]| irradiance([x / z, y / z], z);
                let weakest = light_at([0.0, 0.0, 1100.0]);
                Self { gain: white / (bright * light_at(middle).max(weakest)), of_room: false }
            }
            Exposure::Fixed { white_at_1m } => Self { gain: white_at_1m / bright, of_room: false },
            Exposure::Room { white } => Self { gain: white / bright, of_room: true },
        }
    }

    /// Signal of a surface at depth `z` (mm) on `ray`, share of full scale, not clipped.
    pub fn signal(&self, albedo: f64, cosine: f64, ray: [f64; 2], z: f64) -> f64 {
        if self.of_room {
            return self.gain * albedo * vignetting(ray);
        }
        self.gain * albedo * cosine * irradiance(ray, z)
    }
}

/// Light that reaches the pixel from a surface at depth `z` (mm) on `ray`, relative to 1 m on the axis: (1 m / z)² cos⁴
/// θ. Two of the four powers of the cosine are the illumination's fall with the squared range instead of the squared
/// depth; the other two are the part of the lens' vignetting that the emitter does not compensate.
fn irradiance([x, y]: [f64; 2], z: f64) -> f64 {
    let secant2 = 1.0 + x * x + y * y;
    (1000.0 / z).powi(2) / (secant2 * secant2)
}

/// Darkening towards the image's corners of a camera that the room lights, cos⁴ θ, of which the lens' design leaves half.
fn vignetting([x, y]: [f64; 2]) -> f64 {
    1.0 / (1.0 + x * x + y * y)
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
