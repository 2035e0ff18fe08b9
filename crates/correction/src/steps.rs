//! 16-bit depth to 16-bit depth by one Möbius map, the path of most cameras, in one pass.
//!
//! What is added to a depth is rounded, not the sum: the measured steps are whole already, and the change keeps its digits. The
//! largest depth of a chunk bounds what f32 may be off: where that is less than [`MOST_ERROR`] the result is within half a
//! step and that of the exact inverse, where it is not the chunk is corrected in f64.

#[cfg(target_arch = "x86_64")]
pub(super) mod avx512;

use super::bands::CHUNK;
use super::formats::count_u16;
use super::moebius::{ForTables, Moebius, Slices, for_tables};
use super::simd::Isa;

/// Largest error of a result before it is rounded, steps.
pub(super) const MOST_ERROR: f32 = 1e-3;

/// 1.5 · 2²³: as [`super::formats::ROUND`], for negative numbers too.
const ROUND_SIGNED: f32 = 12_582_912.0;

/// Largest coefficients of each chunk, which bound what a chunk's largest depth can become.
#[derive(Debug, Clone)]
pub(super) struct Bounds {
    chunks: Vec<Bound>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Bound {
    p: f32,
    q: f32,
    r: f32,
    r_above: f32,
    /// Whether all pixels have a ray and nothing is added to their depths: what is valid then stays so.
    whole: bool,
}

impl Bound {
    /// Of both.
    #[inline(always)]
    fn and(self, other: Self) -> Self {
        Self {
            p: self.p.max(other.p),
            q: self.q.max(other.q),
            r: self.r.max(other.r),
            r_above: self.r_above.max(other.r_above),
            whole: self.whole & other.whole,
        }
    }

    /// What depths of up to `steps` need; `None` where results may leave 16 bits, or f64 with tables of f32 is not enough.
    #[inline(always)]
    fn needs(self, steps: u16, unit_mm: f32) -> Option<Precision> {
        let Self { p, q, r, r_above, whole } = self;
        let steps = f32::from(steps);
        let z = steps * unit_mm;
        let left = 1.0 - r_above * z;
        let sum = steps * (p + r * z) + q / unit_mm;
        let change = sum / left;
        let usable = left > 0.05 && steps + change < 65535.0;
        // Depth must not shrink to half: then one step would round to none.
        let kept = !whole || 1.0 - p > 0.55 * (1.0 + r * z);
        if !(usable && kept) {
            return None;
        }
        // Half an ulp (6e-8) of each table; what the pole magnifies of r's.
        let of_tables = 6e-8 * (steps * p + q / unit_mm + r * z * (steps + change)) / left;
        // The same each for z, slope, product, sum and twice for the quotient, and of what is left before the pole, which is
        // near 1. The coefficients are bounds of their sizes, so that this holds where they cancel.
        let of_f32 = of_tables + 6e-8 * (6.0 * change + (r * z + 1.0) / left * change) + 1e-6;
        match (of_f32 < MOST_ERROR, of_tables < MOST_ERROR) {
            (true, _) => Some(Precision::Single),
            (false, true) => Some(Precision::Double),
            _ => None,
        }
    }
}

/// What a chunk needs.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Precision {
    Single,
    Double,
}

/// What the exact inverse makes of a pixel (index, steps) in steps: the result and whether it was beyond the ends.
pub(super) type Exact<'a> = &'a dyn Fn(usize, u16) -> (u16, bool);

impl Bounds {
    /// The bounds of a map over `pixels` pixels.
    pub fn new(map: &Moebius, pixels: usize) -> Self {
        let of_chunk = |first: usize| {
            let c = map.slices(first, CHUNK.min(pixels - first));
            let greatest = |values: &[f32]| values.iter().fold(0.0f32, |m, v| m.max(v.abs()));
            // Pixels that correct nothing have no part: whatever their depth, they have none.
            let poles: Vec<f32> = c.r.iter().copied().filter(|r| *r < 1e29).collect();
            let r_above = poles.iter().copied().fold(0.0, f32::max);
            let p = if c.p.is_empty() { c.p0.abs() } else { greatest(c.p) };
            let whole = poles.len() == c.r.len() && c.q.is_empty() && p < 0.4;
            Bound { p, q: greatest(c.q), r: greatest(&poles), r_above, whole }
        };
        Self { chunks: (0..pixels).step_by(CHUNK).map(of_chunk).collect() }
    }

    /// Of `length` pixels from `first` on, which is the first of a chunk.
    #[inline(always)]
    fn of(&self, first: usize, length: usize) -> Bound {
        let chunks = &self.chunks[first / CHUNK..(first + length).div_ceil(CHUNK)];
        chunks.iter().fold(Bound { whole: true, ..Bound::default() }, |bound, chunk| bound.and(*chunk))
    }
}

/// What became of some pixels.
pub(super) struct Done {
    pub depths: usize,
    pub corrected: usize,
    pub saturated: usize,
}

/// The pixels of a chunk, in steps of `unit_mm`.
pub(super) struct Chunk<'a> {
    pub c: Slices<'a>,
    pub unit_mm: f64,
    pub measured: &'a [u16],
    pub out: &'a mut [u16],
}

/// What a pass over a chunk has seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Seen {
    /// Largest measured depth.
    pub most: u16,
    /// Pixels with measured depth.
    pub depths: usize,
    /// Pixels with a result.
    pub corrected: usize,
}

/// Corrects a chunk from pixel `first` on; `None`, with its output undefined, where it is beyond what this path can do.
#[inline(always)]
pub(super) fn correct<I: Isa>(
    isa: I,
    (map, bounds): (&Moebius, &Bounds),
    first: usize,
    chunk: Chunk<'_>,
    exact: Exact<'_>,
) -> Option<Done> {
    for_tables(map.tables(), Correct { isa, bounds, first, chunk, exact })
}

struct Correct<'a, I> {
    isa: I,
    bounds: &'a Bounds,
    first: usize,
    chunk: Chunk<'a>,
    exact: Exact<'a>,
}

impl<I: Isa> ForTables for Correct<'_, I> {
    type Output = Option<Done>;

    #[inline(always)]
    fn run<const P: bool, const Q: bool, const R: bool>(self) -> Option<Done> {
        let Self { isa, bounds, first, mut chunk, exact } = self;
        let bound = bounds.of(first, chunk.measured.len());
        let mut seen =
            if bound.whole { isa.steps::<P, Q, R, true>(&mut chunk) } else { isa.steps::<P, Q, R, false>(&mut chunk) };
        if bound.needs(seen.most, chunk.unit_mm as f32)? == Precision::Double {
            seen.corrected = in_double::<P, Q, R>(&mut chunk);
        }
        let mut saturated = 0;
        if Q && seen.depths != seen.corrected {
            // An offset may take small depths below half a step, which is no reason to lose them.
            for (i, (raw, out)) in chunk.measured.iter().zip(chunk.out.iter_mut()).enumerate() {
                if *raw > 0 && *out == 0 {
                    let (steps, beyond) = exact(first + i, *raw);
                    *out = steps;
                    saturated += usize::from(beyond);
                }
            }
            seen.corrected = count_u16(chunk.out);
        }
        Some(Done { depths: seen.depths, corrected: seen.corrected, saturated })
    }
}

/// Corrects and rounds in f32, whether that is enough or not. `WHOLE`: all that is valid stays so.
#[inline(always)]
pub(super) fn in_single<I: Isa, const P: bool, const Q: bool, const R: bool, const WHOLE: bool>(
    isa: I,
    chunk: &mut Chunk<'_>,
) -> Seen {
    let Chunk { c, unit_mm, measured, ref mut out } = *chunk;
    let n = measured.len();
    let c = c.first::<P, Q, R>(n);
    let out = &mut out[..n];
    let (unit_mm, per_mm) = (unit_mm as f32, (1.0 / unit_mm) as f32);
    for i in 0..n {
        let (p, q, r) = c.at::<P, Q, R>(i);
        let steps = f32::from(measured[i]);
        let z = steps * unit_mm;
        let slope = if R { isa.mul_add(r, z, p) } else { p };
        let sum = if Q { isa.mul_add(steps, slope, q * per_mm) } else { steps * slope };
        let left = if R { isa.mul_add(-r, z, 1.0) } else { 1.0 };
        let change = if R { isa.divide(sum, left) } else { sum };
        let corrected = u32::from(measured[i]).wrapping_add((change + ROUND_SIGNED).to_bits()) as u16;
        let stays = if R { left > 0.0 } else { true } & if Q { (steps > 0.0) & (steps + change > 0.5) } else { true };
        out[i] = if WHOLE | stays { corrected } else { 0 };
    }
    // After the pass, when the chunk is in the first-level cache.
    let (most, depths) = isa.most_and_count(measured);
    Seen { most, depths, corrected: if WHOLE { depths } else { count_u16(out) } }
}

/// The same in f64. Returns how many pixels have a result.
#[inline(always)]
fn in_double<const P: bool, const Q: bool, const R: bool>(chunk: &mut Chunk<'_>) -> usize {
    /// 1.5 · 2⁵²: [`ROUND_SIGNED`] of f64.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    let Chunk { c, unit_mm, measured, ref mut out } = *chunk;
    let n = measured.len();
    let c = c.first::<P, Q, R>(n);
    let out = &mut out[..n];
    for i in 0..n {
        let (p, q, r) = c.at::<P, Q, R>(i);
        let steps = f64::from(measured[i]);
        let left = 1.0 - f64::from(r) * (steps * unit_mm);
        let sum = steps * (f64::from(p) + f64::from(r) * (steps * unit_mm)) + f64::from(q) / unit_mm;
        let corrected = steps + sum / left;
        let stays = (left > 0.0) & if Q { (steps > 0.0) & (corrected > 0.5) } else { true };
        out[i] = if stays { (corrected + ROUND).to_bits() as u16 } else { 0 };
    }
    count_u16(out)
}

#[cfg(test)]
mod tests {
    use super::super::simd::{Kernel, dispatch};
    use super::*;

    const PIXELS: usize = 147;

    struct Both<'a>(Slices<'a>, &'a [u16], [&'a mut [u16]; 2]);

    impl Kernel for Both<'_> {
        type Output = [[Seen; 2]; 4];
        #[inline(always)]
        fn run<I: Isa>(self, isa: I) -> Self::Output {
            let Self(c, measured, [of_machine, plain]) = self;
            macro_rules! pass {
                ($p:literal, $q:literal, $r:literal) => {{
                    let mut chunk = Chunk { c, unit_mm: 0.5, measured, out: of_machine };
                    let seen = isa.steps::<$p, $q, $r, false>(&mut chunk);
                    let mut chunk = Chunk { c, unit_mm: 0.5, measured, out: plain };
                    let expected = in_single::<I, $p, $q, $r, false>(isa, &mut chunk);
                    let apart = |(a, b): (&u16, &u16)| a.abs_diff(*b) > 1;
                    assert!(!of_machine.iter().zip(plain.iter()).any(apart));
                    [seen, expected]
                }};
            }
            [pass!(false, false, true), pass!(true, false, false), pass!(true, false, true), pass!(true, true, true)]
        }
    }

    #[test]
    fn the_machines_own_loop_does_what_the_plain_one_does() {
        let at = |i: usize, size: f32| size * (0.37 * i as f32).sin();
        let p: Vec<f32> = (0..PIXELS).map(|i| at(i, 0.2)).collect();
        let q: Vec<f32> = (0..PIXELS).map(|i| at(i + 5, 20.0)).collect();
        // Some pixels have no ray.
        let r: Vec<f32> = (0..PIXELS).map(|i| if i % 19 == 3 { 1e30 } else { at(2 * i, 4e-4) }).collect();
        let measured: Vec<u16> = (0..PIXELS).map(|i| if i % 7 == 1 { 0 } else { (i * 77 % 4000) as u16 }).collect();
        let (mut a, mut b) = ([0; PIXELS], [0; PIXELS]);
        let c = Slices { p0: 0.01, p: &p, q: &q, r: &r };
        for [seen, expected] in dispatch(Both(c, &measured, [&mut a, &mut b])) {
            assert_eq!((seen.most, seen.depths), (expected.most, expected.depths));
            assert_eq!(seen.most, measured.iter().copied().max().unwrap());
            // A result within rounding of half a step may fall on either side.
            assert!(seen.corrected.abs_diff(expected.corrected) <= 1, "{seen:?} {expected:?}");
        }
    }
}
