//! Options of rendering.

use serde::{Deserialize, Serialize};

use crate::error::{SimulateError, not_negative, positive};

/// Options of rendering: the camera's output format, the background, and defects of depth pixels.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Rendering {
    /// Bits of the image, 8 or 16.
    pub image_bits: u8,
    /// True unit of the 16-bit depth image, mm per step.
    pub depth_unit_mm: f64,
    /// Largest depth that is measured, mm.
    pub max_range_mm: f64,
    /// Distance of the wall behind the board, mm; 0 for none.
    pub wall_mm: f64,
    /// Number of objects between board and wall.
    pub clutter: usize,
    /// Frequency of missing depth on and around dots, at the board's outline and elsewhere: 0 for never, 1 for the
    /// usual one.
    pub holes: f64,
    /// Standard deviation of depth noise at the edges of the print, relative to that elsewhere.
    pub edge_noise: f64,
    /// Whether valid depth pixels at the board's outline mix the depths of board and background.
    pub mixed_pixels: bool,
    /// Frequencies by which a time-of-flight camera modulates its light, MHz; 0 for one that is not used. Stray light depends on
    /// them.
    pub modulation_mhz: [f64; 3],
}

impl Default for Rendering {
    fn default() -> Self {
        Self {
            image_bits: 8,
            depth_unit_mm: 0.125,
            max_range_mm: 2500.0,
            wall_mm: 2200.0,
            clutter: 0,
            holes: 1.0,
            edge_noise: 2.0,
            mixed_pixels: false,
            // A Kinect v2.
            modulation_mhz: [16.0, 80.0, 120.0],
        }
    }
}

impl Rendering {
    pub(crate) fn check(&self) -> Result<(), SimulateError> {
        if !matches!(self.image_bits, 8 | 16) {
            let value = f64::from(self.image_bits);
            return Err(SimulateError::BadParameter { field: "rendering.image_bits", value, expected: "8 or 16" });
        }
        positive([("rendering.depth_unit_mm", self.depth_unit_mm), ("rendering.max_range_mm", self.max_range_mm)])?;
        let modulation_mhz = self.modulation_mhz.iter().sum::<f64>();
        if !(modulation_mhz.is_finite() && modulation_mhz > 0.0 && self.modulation_mhz.iter().all(|f| *f >= 0.0)) {
            let (field, expected) = ("rendering.modulation_mhz", "frequencies of which one is positive");
            return Err(SimulateError::BadParameter { field, value: modulation_mhz, expected });
        }
        not_negative([
            ("rendering.wall_mm", self.wall_mm),
            ("rendering.holes", self.holes),
            ("rendering.edge_noise", self.edge_noise),
        ])
    }
}
