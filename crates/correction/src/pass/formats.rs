//! Formats of depth: 16-bit steps and f32 millimetres.

use crate::simd::measurement;

/// 2²³: adding it to an f32 between 0 and 2²² rounds that to a whole number, which is then in the lower bits.
pub(crate) const ROUND: f32 = 8_388_608.0;

/// A measured depth.
pub(crate) trait Sample: Copy + Send + Sync {
    /// The depth in mm; 0 where it is invalid.
    fn millimetres(self, unit_mm: f32) -> f32;
}

impl Sample for u16 {
    #[inline(always)]
    fn millimetres(self, unit_mm: f32) -> f32 {
        f32::from(measurement(self)) * unit_mm
    }
}

impl Sample for f32 {
    #[inline(always)]
    fn millimetres(self, _: f32) -> f32 {
        if (self > 0.0) & (self < f32::INFINITY) { self } else { 0.0 }
    }
}

/// Converts measured depth to mm.
#[inline(always)]
pub(crate) fn load<T: Sample>(samples: &[T], unit_mm: f32, z: &mut [f32]) {
    for (z, sample) in z.iter_mut().zip(samples) {
        *z = sample.millimetres(unit_mm);
    }
}

/// Writes depth in steps of 1/`per_mm` mm, rounded and limited to 1 … 65535; 0 stays 0. Returns the number of depths
/// beyond these limits.
#[inline(always)]
pub(crate) fn store_u16(z: &[f32], per_mm: f32, out: &mut [u16]) -> usize {
    let mut beyond = 0u32;
    for (z, out) in z.iter().zip(out) {
        let steps = *z * per_mm;
        let limited = steps.clamp(1.0, 65535.0);
        let rounded = limited + ROUND;
        let is_depth = *z > 0.0;
        *out = if is_depth { rounded.to_bits() as u16 } else { 0 };
        beyond += u32::from(is_depth & !(0.5..65535.5).contains(&steps));
    }
    beyond as usize
}

/// Writes depth in mm; infinite depth becomes the largest f32. Returns the number of such depths.
#[inline(always)]
pub(crate) fn store_f32(z: &[f32], out: &mut [f32]) -> usize {
    let mut beyond = 0u32;
    for (z, out) in z.iter().zip(out) {
        let limited = z.min(f32::MAX);
        beyond += u32::from(limited != *z);
        *out = limited;
    }
    beyond as usize
}
