//! Stray light at a pixel.

use serde::{Deserialize, Serialize};

use super::modulation::FREQUENCIES;

/// The light that reaches a pixel by other ways than its own ray, as shares of the pixel's own signal. Own signal is the mean
/// amplitude over 3×3 pixels, which is what a camera that smooths its raw images measures.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct StrayLight {
    /// Phasor of the light of the whole scene at each modulation frequency, real and imaginary part, over the pixel's own
    /// amplitude; NaN where unknown. Its own phase is not taken off.
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

/// Phasors of the scene's light at each frequency, in steps of the amplitude image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Phasors(pub [[f32; 2]; FREQUENCIES]);

impl Phasors {
    /// As shares of a pixel's own amplitude.
    #[inline(always)]
    pub fn over(self, local: f32, near: f32) -> StrayLight {
        StrayLight { scene: self.0.map(|p| p.map(|part| part / local)), near }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pixel at the border of an amplitude image has the light of its neighbours and not that of the scene, or the other way
    /// round.
    #[test]
    fn light_is_known_only_where_both_parts_are() {
        let known = StrayLight { scene: [[0.5, -0.1]; FREQUENCIES], near: 1.2 };
        assert!(known.is_known());
        assert!(!StrayLight { near: f32::NAN, ..known }.is_known());
        assert!(!StrayLight { scene: StrayLight::UNKNOWN.scene, ..known }.is_known());
        assert!(!StrayLight::UNKNOWN.is_known());
        let dark = Phasors([[3.0, 4.0]; FREQUENCIES]);
        assert!(!dark.over(0.0, f32::INFINITY).is_known(), "a pixel without signal");
        assert_eq!(dark.over(2.0, 1.1), StrayLight { scene: [[1.5, 2.0]; FREQUENCIES], near: 1.1 });
    }
}
