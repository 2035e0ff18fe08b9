//! Uncertainty of corrected depth: what noise, frames and the camera's parameters leave open.

use super::camera::{STEP, UncertainCamera};
use super::noise::DepthNoise;
use super::support::Support;
use crate::camera::Camera;
use crate::piece::Context;

/// Standard deviations of corrected depth, mm; NaN where depth cannot be corrected.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DepthStdDev {
    /// By the parameters of the calibration: an error that all frames have in common.
    pub parameters_mm: f64,
    /// By the noise of one pixel; what every frame has of its own is a part of it.
    pub noise_mm: f64,
}

impl DepthStdDev {
    /// Of both.
    pub fn total_mm(&self) -> f64 {
        self.parameters_mm.hypot(self.noise_mm)
    }
}

/// A calibrated depth camera with all that makes its corrected depth uncertain.
#[derive(Debug, Clone)]
pub struct UncertainDepth {
    /// The camera.
    pub camera: Camera,
    /// The camera changed to either side along every direction of its parameters' uncertainty.
    changed: Vec<[Camera; 2]>,
    /// Noise of measured depth.
    pub noise: DepthNoise,
    /// Conditions under which it is asked: time and temperature in the middle of those of the fit.
    pub conditions: Context,
    /// Where boards were seen; `None` where that is unknown.
    pub support: Option<Support>,
}

impl UncertainDepth {
    /// Depth of a camera with the covariance of its parameters, with noise.
    pub fn new(uncertain: &UncertainCamera, noise: DepthNoise, conditions: Context) -> Self {
        let (camera, changed) = (uncertain.camera.clone(), uncertain.changed());
        Self { camera, changed, noise, conditions, support: None }
    }

    /// Whether the parameters are uncertain; if not, noise alone is.
    pub fn has_covariance(&self) -> bool {
        !self.changed.is_empty()
    }

    /// A pixel under the conditions of the fit.
    pub fn at(&self, pixel: [f64; 2]) -> Context {
        Context { pixel, ..self.conditions }
    }

    /// Standard deviations at a pixel, its conditions and a measured depth, mm, by central differences along every direction.
    pub fn std_dev(&self, context: &Context, measured_mm: f64) -> DepthStdDev {
        let corrected =
            |camera: &Camera, rho: f64| camera.correct(context, 1.0, rho).map_or(f64::NAN, |(_, rho)| 1.0 / rho);
        let rho = 1.0 / measured_mm;
        let along = |[plus, minus]: &[Camera; 2]| (corrected(plus, rho) - corrected(minus, rho)) / (2.0 * STEP);
        let variance: f64 = self.changed.iter().map(|pair| along(pair).powi(2)).sum();
        let sigma = self.noise.sigma(rho);
        // Where σ is not small against ρ, the far side is at infinity.
        let step = (STEP * sigma).min(0.01 * rho);
        let slope = (corrected(&self.camera, rho - step) - corrected(&self.camera, rho + step)) / (2.0 * step);
        let noise_mm = if sigma > 0.0 { (slope * sigma).abs() } else { 0.0 };
        DepthStdDev { parameters_mm: variance.sqrt(), noise_mm }
    }
}
