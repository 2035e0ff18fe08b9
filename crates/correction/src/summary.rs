//! Counts of corrected and uncorrected pixels.

use std::ops::{Add, AddAssign};

/// Number of pixels by what became of them, in one frame or summed over several. `corrected`, `invalid` and
/// `not_correctable` add up to all pixels.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct CorrectionSummary {
    /// Pixels with a corrected depth.
    pub corrected: usize,
    /// Corrected pixels whose depth lies beyond the range of the output type and was set to the nearest end of it.
    pub saturated: usize,
    /// Pixels without a measured depth: 0 or 65535 in images of 16 bits.
    pub invalid: usize,
    /// Pixels with a measured depth but no corrected one: they have no ray, or the model has no inverse there.
    pub not_correctable: usize,
}

impl Add for CorrectionSummary {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            corrected: self.corrected + other.corrected,
            saturated: self.saturated + other.saturated,
            invalid: self.invalid + other.invalid,
            not_correctable: self.not_correctable + other.not_correctable,
        }
    }
}

impl AddAssign for CorrectionSummary {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}
