//! Correction of a chunk in f32, as plain loops.

use crate::plan::Coefficients;
use crate::simd::{Isa, count_u16, measurement};

/// 1.5 · 2²³: adding it to an f32 between −2²² and 2²² rounds that to a whole number, which is then in the lower bits.
const ROUND_SIGNED: f32 = 12_582_912.0;

/// Consecutive pixels to be corrected: coefficients, measured depth and the place of the results, both in steps of
/// `unit_mm`.
pub(crate) struct Chunk<'a> {
    pub c: Coefficients<'a>,
    pub unit_mm: f64,
    pub measured: &'a [u16],
    pub out: &'a mut [u16],
}

/// Counts of a pass over a chunk.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct PassCounts {
    /// Largest measured depth.
    pub most: u16,
    /// Pixels with a measured depth.
    pub depths: usize,
    /// Pixels with a corrected depth.
    pub corrected: usize,
}

/// Corrects a chunk and rounds the results, in f32 whether that is precise enough or not. P, Q and R tell which
/// coefficients are tables, KEEPS_VALID whether every valid depth has a valid result
/// ([`Bound::keeps_valid`](super::bounds::Bound)).
#[inline(always)]
pub(crate) fn in_single<I: Isa, const P: bool, const Q: bool, const R: bool, const KEEPS_VALID: bool>(
    isa: I,
    chunk: &mut Chunk<'_>,
) -> PassCounts {
    let Chunk { c, unit_mm, measured, ref mut out } = *chunk;
    let n = measured.len();
    let c = c.first::<P, Q, R>(n);
    let out = &mut out[..n];
    let (unit_mm, per_mm) = (unit_mm as f32, (1.0 / unit_mm) as f32);
    for i in 0..n {
        let (p, q, r) = c.at::<P, Q, R>(i);
        let raw = measurement(measured[i]);
        let steps = f32::from(raw);
        let z = steps * unit_mm;
        let slope = if R { isa.mul_add(r, z, p) } else { p };
        let sum = if Q { isa.mul_add(steps, slope, q * per_mm) } else { steps * slope };
        let left = if R { isa.mul_add(-r, z, 1.0) } else { 1.0 };
        let change = if R { isa.divide(sum, left) } else { sum };
        let corrected = u32::from(raw).wrapping_add((change + ROUND_SIGNED).to_bits()) as u16;
        let keeps = if R { left > 0.0 } else { true } & if Q { (steps > 0.0) & (steps + change > 0.5) } else { true };
        out[i] = if KEEPS_VALID | keeps { corrected } else { 0 };
    }
    // Counted after the loop, while the chunk is in the first-level cache.
    let (most, depths) = isa.max_and_count(measured);
    PassCounts { most, depths, corrected: if KEEPS_VALID { depths } else { count_u16(out) } }
}
