//! Modulation frequencies of a time-of-flight camera.

use std::collections::BTreeMap;

/// Most modulation frequencies of a camera.
pub const FREQUENCIES: usize = 3;
/// Modulation frequencies of the Kinect v2, MHz.
pub const KINECT_V2_MHZ: [f64; FREQUENCIES] = [16.0, 80.0, 120.0];
/// Speed of light, mm/s.
pub const LIGHT_MM_PER_S: f64 = 299_792_458e3;

/// Names of the frequencies among a piece's constants.
pub(crate) const NAMES: [&str; FREQUENCIES] = ["f1_mhz", "f2_mhz", "f3_mhz"];

/// The frequencies by which a camera modulates its light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Modulation {
    /// Frequencies, MHz; 0 for one that is not used.
    pub mhz: [f64; FREQUENCIES],
}

impl Default for Modulation {
    fn default() -> Self {
        Self { mhz: KINECT_V2_MHZ }
    }
}

impl Modulation {
    /// The frequencies among a piece's constants. Where any is given, those that are not given are not used; where none is, they
    /// are those of the Kinect v2. What is no frequency becomes 0.
    pub fn of(given: &BTreeMap<String, f64>) -> Self {
        if NAMES.iter().all(|name| !given.contains_key(*name)) {
            return Self::default();
        }
        let mhz = NAMES.map(|name| given.get(name).copied().filter(|f| f.is_finite() && *f > 0.0).unwrap_or(0.0));
        Self { mhz }
    }

    /// Sum of the frequencies, Hz.
    pub fn sum_hz(&self) -> f64 {
        self.mhz.iter().sum::<f64>() * 1e6
    }

    /// Change of phase with range, rad/mm: 4π f / c for each frequency.
    pub fn rad_per_mm(&self) -> [f64; FREQUENCIES] {
        self.mhz.map(|f| 4.0 * std::f64::consts::PI * f * 1e6 / LIGHT_MM_PER_S)
    }
}
