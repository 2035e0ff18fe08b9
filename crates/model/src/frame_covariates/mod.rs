//! Covariates that a whole frame determines: the light of the scene that the lens spreads over all pixels.
//!
//! Everything here works on slices, row by row, and takes the range of a pixel from a function, so that calibration and correction
//! compute the same numbers from images of any type. A frame costs one pass over its pixels ([`Scene::row`]) and a sum over some
//! hundred blocks ([`Scene::spread`]).

mod modulation;
mod phase;
mod scene;
mod spread;
mod window;

pub use modulation::{FREQUENCIES, KINECT_V2_MHZ, LIGHT_MM_PER_S, Modulation};
pub use phase::{phasor, turns_per_mm};
pub use scene::{BLOCK_PX, BlockSum, Scene};
pub use spread::{SPREAD_PX, SceneLight};
pub use window::{NEAR_PX, NEAR_REACH, NEAR_WEIGHTS, OWN_REACH, own_and_near};

/// The light that reaches a pixel by other ways than its own ray, as shares of the pixel's own signal (DESIGN of the effect
/// `stray_light`). Own signal is the mean amplitude over 3×3 pixels, which is what a camera that smooths its raw images measures.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct StrayLight {
    /// Phasor of the light of the whole scene at each modulation frequency, real and imaginary part, over the pixel's own amplitude;
    /// NaN where unknown. Its own phase is not taken off.
    pub scene: [[f32; 2]; FREQUENCIES],
    /// Amplitude of the light of the nearest pixels over the pixel's own; NaN where unknown.
    pub near: f32,
}

impl StrayLight {
    /// Nothing is known.
    pub const UNKNOWN: Self = Self { scene: [[f32::NAN; 2]; FREQUENCIES], near: f32::NAN };

    /// Whether it is known. A pixel without any signal of its own has none.
    #[inline(always)]
    pub fn is_known(&self) -> bool {
        self.near.is_finite() && self.scene[0][0].is_finite()
    }
}

impl Default for StrayLight {
    fn default() -> Self {
        Self::UNKNOWN
    }
}

/// The covariates of one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameCovariates {
    scene: SceneLight,
}

impl FrameCovariates {
    /// Of a frame with `width` × `height` pixels: its amplitudes, row by row, and the range of every pixel by its index, mm; 0, NaN
    /// or infinity where none was measured. `None` where the sizes contradict each other or nothing was measured.
    pub fn new(
        modulation: Modulation,
        [width, height]: [usize; 2],
        amplitude: &[u16],
        range_mm: impl Fn(usize) -> f32,
    ) -> Option<Self> {
        if amplitude.len() != width * height {
            return None;
        }
        let scene = Scene::new(modulation, [width, height]);
        let rows = (0..scene.rows()).flat_map(|row| scene.row(row, amplitude, &range_mm));
        Some(Self { scene: scene.spread(rows.collect())? })
    }

    /// The stray light at a pixel of the frame, given its amplitudes.
    pub fn at(&self, amplitude: &[u16], [u, v]: [usize; 2]) -> StrayLight {
        let (own, near) = own_and_near(amplitude, self.scene.size(), [u, v]);
        if own > 0.0 { self.scene.at([u as f32, v as f32]).over(own, near / own) } else { StrayLight::UNKNOWN }
    }
}

/// Phasors of the scene's light at each frequency, in steps of the amplitude image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Phasors(pub [[f32; 2]; FREQUENCIES]);

impl Phasors {
    /// As shares of a pixel's own amplitude.
    #[inline(always)]
    pub fn over(self, own: f32, near: f32) -> StrayLight {
        StrayLight { scene: self.0.map(|p| p.map(|part| part / own)), near }
    }
}
