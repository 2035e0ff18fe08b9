//! Noise of image and depth.

use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal, StudentT};
use serde::{Deserialize, Serialize};

use crate::error::{SimulateError, check, not_negative};

/// Law by which depth noise grows with distance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "law", rename_all = "kebab-case")]
pub enum DepthNoise {
    /// Structured light and stereo: constant in inverse depth.
    Disparity {
        /// Standard deviation in ρ, 1/mm.
        sigma_rho: f64,
    },
    /// Time of flight: constant in depth.
    TimeOfFlight {
        /// Standard deviation in z, mm.
        sigma_mm: f64,
    },
}

impl DepthNoise {
    /// Standard deviation in inverse depth at inverse depth `rho`, 1/mm.
    pub fn sigma_rho(self, rho: f64) -> f64 {
        match self {
            Self::Disparity { sigma_rho } => sigma_rho,
            Self::TimeOfFlight { sigma_mm } => sigma_mm * rho * rho,
        }
    }
}

/// Noise, blur and quantisation of the camera.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Noise {
    /// Noise of depth.
    pub depth: DepthNoise,
    /// Correlation of depth noise between neighbouring pixels: standard deviation of the Gaussian with which white
    /// noise is filtered, px; 0 for white noise. Only in rendered images.
    pub depth_correlation_px: f64,
    /// Quantisation step of the measured disparity, expressed in ρ, 1/mm; 0 for none. Only in rendered images.
    pub depth_step_rho: f64,
    /// Degrees of freedom (above 2) of Student's t distribution, scaled to the same standard deviation, in place of the
    /// normal distribution: for markers and depth of point observations, and for depth in rendered images.
    pub tail_dof: Option<f64>,
    /// Standard deviation of the image's blur, px.
    pub blur_px: f64,
    /// Read noise, share of full scale.
    pub image_read: f64,
    /// Shot noise: variance over signal, both as shares of full scale.
    pub image_shot: f64,
}

impl Default for Noise {
    /// Structured light: about 0.5 mm at 500 mm and 2 mm at 1 m, correlated between neighbouring pixels.
    fn default() -> Self {
        Self {
            depth: DepthNoise::Disparity { sigma_rho: 2e-6 },
            depth_correlation_px: 1.3,
            depth_step_rho: 5e-7,
            tail_dof: None,
            blur_px: 0.7,
            image_read: 0.004,
            image_shot: 1.5e-4,
        }
    }
}

impl Noise {
    /// No noise, no blur, no steps in disparity.
    pub fn none() -> Self {
        Self {
            depth: DepthNoise::Disparity { sigma_rho: 0.0 },
            depth_correlation_px: 0.0,
            depth_step_rho: 0.0,
            tail_dof: None,
            blur_px: 0.0,
            image_read: 0.0,
            image_shot: 0.0,
        }
    }

    pub(crate) fn check(&self) -> Result<(), SimulateError> {
        let law = match self.depth {
            DepthNoise::Disparity { sigma_rho } => sigma_rho,
            DepthNoise::TimeOfFlight { sigma_mm } => sigma_mm,
        };
        not_negative([
            ("noise.depth", law),
            ("noise.depth_correlation_px", self.depth_correlation_px),
            ("noise.depth_step_rho", self.depth_step_rho),
            ("noise.blur_px", self.blur_px),
            ("noise.image_read", self.image_read),
            ("noise.image_shot", self.image_shot),
        ])?;
        check(self.tail_dof.map(|value| ("noise.tail_dof", value)), "more than 2", |value| value > 2.0)
    }

    /// The distribution of standardised noise.
    pub(crate) fn unit(&self) -> UnitNoise {
        match self.tail_dof.and_then(|dof| StudentT::new(dof).ok().map(|t| (t, ((dof - 2.0) / dof).sqrt()))) {
            Some((t, scale)) => UnitNoise::Heavy(t, scale),
            None => UnitNoise::Normal,
        }
    }
}

/// Noise of mean 0 and variance 1.
#[derive(Debug, Clone, Copy)]
pub(crate) enum UnitNoise {
    Normal,
    Heavy(StudentT<f64>, f64),
}

impl UnitNoise {
    pub fn draw(&self, rng: &mut impl Rng) -> f64 {
        match self {
            Self::Normal => rng.sample(StandardNormal),
            Self::Heavy(t, scale) => scale * t.sample(rng),
        }
    }
}
