//! The covariates of a frame, from its images.

use super::modulation::Modulation;
use super::scene::Scene;
use super::spread::SceneLight;
use super::stray::StrayLight;
use super::window::own_and_near;

/// The covariates of one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameCovariates {
    scene: SceneLight,
}

impl FrameCovariates {
    /// Of a frame with `width` × `height` pixels: its amplitudes, row by row, and the range of every pixel by its index, mm; 0,
    /// NaN or infinity where none was measured. `None` where the sizes contradict each other or nothing was measured.
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
        let (local, near) = own_and_near(amplitude, self.scene.size(), [u, v]);
        if local > 0.0 { self.scene.at([u as f32, v as f32]).over(local, near / local) } else { StrayLight::UNKNOWN }
    }
}
