//! Depth as it comes and as it goes: 16-bit steps, f32 millimetres.

use super::simd::Isa;

/// 2²³: adding it to a number between 0 and 2²² rounds that to a whole number, which is then in the lower bits.
pub(super) const ROUND: f32 = 8_388_608.0;

/// A measured depth.
pub(super) trait Sample: Copy + Send + Sync {
    /// In mm; 0 where it is no depth.
    fn millimetres(self, unit_mm: f32) -> f32;
}

impl Sample for u16 {
    #[inline(always)]
    fn millimetres(self, unit_mm: f32) -> f32 {
        f32::from(self) * unit_mm
    }
}

impl Sample for f32 {
    #[inline(always)]
    fn millimetres(self, _: f32) -> f32 {
        if (self > 0.0) & (self < f32::INFINITY) { self } else { 0.0 }
    }
}

/// Reads some pixels as mm.
#[inline(always)]
pub(super) fn load<T: Sample>(samples: &[T], unit_mm: f32, z: &mut [f32]) {
    for (z, sample) in z.iter_mut().zip(samples) {
        *z = sample.millimetres(unit_mm);
    }
}

/// Writes depth in steps of 1/`per_mm` mm, rounded, from 1 to 65535; what is 0 stays 0. Returns how many were beyond the
/// ends.
#[inline(always)]
pub(super) fn store_u16<I: Isa>(_: I, z: &[f32], per_mm: f32, out: &mut [u16]) -> usize {
    let mut beyond = 0u32;
    for (z, out) in z.iter().zip(out) {
        let steps = *z * per_mm;
        let held = steps.clamp(1.0, 65535.0);
        let rounded = held + ROUND;
        let is_depth = *z > 0.0;
        *out = if is_depth { rounded.to_bits() as u16 } else { 0 };
        beyond += u32::from(is_depth & !(0.5..65535.5).contains(&steps));
    }
    beyond as usize
}

/// Writes depth in mm; results that f32 cannot hold end at its ends. Returns how many.
#[inline(always)]
pub(super) fn store_f32(z: &[f32], out: &mut [f32]) -> usize {
    let mut beyond = 0u32;
    for (z, out) in z.iter().zip(out) {
        let held = z.min(f32::MAX);
        beyond += u32::from(held != *z);
        *out = held;
    }
    beyond as usize
}

/// How many of some values are not 0.
#[inline(always)]
pub(super) fn count_u16(values: &[u16]) -> usize {
    let mut count = 0;
    for part in values.chunks(usize::from(u16::MAX)) {
        // Sums of 16 bits, so that as many lanes count at once.
        let mut of_part = 0u16;
        for value in part {
            of_part += (*value).min(1);
        }
        count += usize::from(of_part);
    }
    count
}

/// How many of some values are above 0, and how many are NaN.
#[inline(always)]
pub(super) fn count_f32(values: &[f32]) -> (usize, usize) {
    let (mut depths, mut nans) = (0u32, 0u32);
    for value in values {
        depths += u32::from(*value > 0.0);
        nans += u32::from(value.is_nan());
    }
    (depths as usize, nans as usize)
}
