//! Correction of a chunk in the precision that it needs.

#[cfg(target_arch = "x86_64")]
use pulp::x86::V4;

#[cfg(target_arch = "x86_64")]
use super::avx512;
use super::bounds::{Bounds, Precision};
use super::chunk::{Chunk, PassCounts, in_single};
use crate::plan::{ForTables, Moebius, for_tables};
use crate::simd::{Isa, Specialised, count_u16, measurement};

/// The exact inverse of a pixel: maps its index and its measured depth to true depth, both in steps, and tells whether
/// that was limited to the range of 16 bits.
pub(crate) type ExactInverse<'a> = &'a dyn Fn(usize, u16) -> (u16, bool);

/// Numbers of pixels by what became of them.
pub(crate) struct Corrected {
    /// Pixels with a measured depth.
    pub depths: usize,
    /// Pixels with a corrected depth.
    pub corrected: usize,
    /// Corrected pixels that were limited to the range of 16 bits.
    pub saturated: usize,
}

/// Corrects a chunk that begins at pixel `first`. `None`, with unspecified output, where f64 with coefficients in f32
/// is not precise enough or results may exceed 16 bits.
#[inline(always)]
pub(crate) fn correct<I: Isa>(
    isa: I,
    (map, bounds): (&Moebius, &Bounds),
    first: usize,
    chunk: Chunk<'_>,
    exact: ExactInverse<'_>,
) -> Option<Corrected> {
    for_tables(map.tables(), Correct { isa, bounds, first, chunk, exact })
}

struct Correct<'a, I> {
    isa: I,
    bounds: &'a Bounds,
    first: usize,
    chunk: Chunk<'a>,
    exact: ExactInverse<'a>,
}

impl<I: Isa> ForTables for Correct<'_, I> {
    type Output = Option<Corrected>;

    #[inline(always)]
    fn run<const P: bool, const Q: bool, const R: bool>(self) -> Option<Corrected> {
        let Self { isa, bounds, first, mut chunk, exact } = self;
        let bound = bounds.of(first, chunk.measured.len());
        let mut counts = if bound.keeps_valid {
            isa.specialised(InSingle::<P, Q, R, true>(&mut chunk))
        } else {
            isa.specialised(InSingle::<P, Q, R, false>(&mut chunk))
        };
        if bound.needs(counts.most, chunk.unit_mm as f32)? == Precision::Double {
            counts.corrected = in_double::<P, Q, R>(&mut chunk);
        }
        let mut saturated = 0;
        if Q && counts.depths != counts.corrected {
            // An offset may take a small depth below half a step; the exact inverse limits it to 1 instead of losing
            // it.
            for (i, (raw, out)) in chunk.measured.iter().zip(chunk.out.iter_mut()).enumerate() {
                if measurement(*raw) > 0 && *out == 0 {
                    let (steps, beyond) = exact(first + i, *raw);
                    *out = steps;
                    saturated += usize::from(beyond);
                }
            }
            counts.corrected = count_u16(chunk.out);
        }
        Some(Corrected { depths: counts.depths, corrected: counts.corrected, saturated })
    }
}

/// [`in_single`], or AVX-512's version of it.
struct InSingle<'a, 'c, const P: bool, const Q: bool, const R: bool, const KEEPS_VALID: bool>(&'a mut Chunk<'c>);

impl<const P: bool, const Q: bool, const R: bool, const KEEPS_VALID: bool> Specialised
    for InSingle<'_, '_, P, Q, R, KEEPS_VALID>
{
    type Output = PassCounts;

    #[inline(always)]
    fn portable<I: Isa>(self, isa: I) -> PassCounts {
        in_single::<I, P, Q, R, KEEPS_VALID>(isa, self.0)
    }

    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    fn avx512(self, v4: V4) -> PassCounts {
        avx512::in_single::<P, Q, R, KEEPS_VALID>(v4, self.0)
    }
}

/// Corrects a chunk and rounds the results, in f64 with coefficients in f32. Returns the number of pixels with a
/// corrected depth.
#[inline(always)]
fn in_double<const P: bool, const Q: bool, const R: bool>(chunk: &mut Chunk<'_>) -> usize {
    /// 1.5 · 2⁵²: adding it rounds an f64 to a whole number, which is then in the lower bits.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    let Chunk { c, unit_mm, measured, ref mut out } = *chunk;
    let n = measured.len();
    let c = c.first::<P, Q, R>(n);
    let out = &mut out[..n];
    for i in 0..n {
        let (p, q, r) = c.at::<P, Q, R>(i);
        let steps = f64::from(measurement(measured[i]));
        let left = 1.0 - f64::from(r) * (steps * unit_mm);
        let sum = steps * (f64::from(p) + f64::from(r) * (steps * unit_mm)) + f64::from(q) / unit_mm;
        let corrected = steps + sum / left;
        let keeps = (left > 0.0) & if Q { (steps > 0.0) & (corrected > 0.5) } else { true };
        out[i] = if keeps { (corrected + ROUND).to_bits() as u16 } else { 0 };
    }
    count_u16(out)
}

#[cfg(test)]
mod tests {
    use depthcal_io::DepthImage;

    use super::*;
    use crate::plan::Coefficients;
    use crate::simd::{Kernel, dispatch};

    const PIXELS: usize = 147;

    struct Both<'a>(Coefficients<'a>, &'a [u16], [&'a mut [u16]; 2]);

    impl Kernel for Both<'_> {
        type Output = [[PassCounts; 2]; 4];
        #[inline(always)]
        fn run<I: Isa>(self, isa: I) -> Self::Output {
            let Self(c, measured, [of_machine, plain]) = self;
            macro_rules! pass {
                ($p:literal, $q:literal, $r:literal) => {{
                    let mut chunk = Chunk { c, unit_mm: 0.5, measured, out: of_machine };
                    let seen = isa.specialised(InSingle::<$p, $q, $r, false>(&mut chunk));
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
    fn the_specialised_loop_agrees_with_the_plain_one() {
        let wave = |i: usize, size: f32| size * (0.37 * i as f32).sin();
        let p: Vec<f32> = (0..PIXELS).map(|i| wave(i, 0.2)).collect();
        let q: Vec<f32> = (0..PIXELS).map(|i| wave(i + 5, 20.0)).collect();
        // Some pixels have no ray.
        let r: Vec<f32> = (0..PIXELS).map(|i| if i % 19 == 3 { 1e30 } else { wave(2 * i, 4e-4) }).collect();
        let of_pixel = |i: usize| match i % 7 {
            1 => 0,
            4 => u16::MAX,
            _ => (i * 77 % 4000) as u16,
        };
        let measured: Vec<u16> = (0..PIXELS).map(of_pixel).collect();
        let measurements = || measured.iter().copied().filter(|raw| DepthImage::is_measurement(*raw));
        let (mut a, mut b) = ([0; PIXELS], [0; PIXELS]);
        let c = Coefficients { p0: 0.01, p: &p, q: &q, r: &r };
        for [seen, expected] in dispatch(Both(c, &measured, [&mut a, &mut b])) {
            assert_eq!((seen.most, seen.depths), (expected.most, expected.depths));
            assert_eq!(seen.most, measurements().max().unwrap());
            assert_eq!(seen.depths, measurements().count());
            // A result within rounding of half a step may fall on either side.
            assert!(seen.corrected.abs_diff(expected.corrected) <= 1, "{seen:?} {expected:?}");
        }
    }

    /// In f64 results are those of the formula, to the step; 0 beyond the pole, without a measurement, and below half a step.
    #[test]
    fn what_single_precision_does_not_resolve_is_rounded_in_double() {
        const UNIT_MM: f64 = 0.25;
        let p: Vec<f32> = (0..PIXELS).map(|i| 0.1 * (0.37 * i as f32).sin()).collect();
        let q: Vec<f32> = (0..PIXELS).map(|i| 30.0 * (0.61 * i as f32).sin()).collect();
        let r: Vec<f32> =
            (0..PIXELS).map(|i| if i % 19 == 3 { 1e30 } else { 1e-5 * (0.83 * i as f32).sin() }).collect();
        let measured: Vec<u16> = (0..PIXELS).map(|i| if i % 11 == 1 { 0 } else { (i * 397 % 50_000) as u16 }).collect();
        let c = Coefficients { p0: 0.0, p: &p, q: &q, r: &r };
        let check = |with_q: bool, out: &[u16], corrected: usize| {
            for i in 0..PIXELS {
                let z = f64::from(measured[i]) * UNIT_MM;
                let (p, q, r) = (f64::from(p[i]), if with_q { f64::from(q[i]) } else { 0.0 }, f64::from(r[i]));
                let steps = (z + (z * (p + r * z) + q) / (1.0 - r * z)) / UNIT_MM;
                let is_valid = measured[i] > 0 && r * z < 1.0 && steps > 0.5;
                let expected = if is_valid { steps.round() as u16 } else { 0 };
                assert_eq!(out[i], expected, "pixel {i}: {steps}");
            }
            assert_eq!(corrected, out.iter().filter(|steps| **steps > 0).count());
            // Most pixels have a result.
            assert!(corrected > PIXELS / 2);
        };
        let mut out = [0; PIXELS];
        let corrected =
            in_double::<true, true, true>(&mut Chunk { c, unit_mm: UNIT_MM, measured: &measured, out: &mut out });
        check(true, &out, corrected);
        let corrected =
            in_double::<true, false, true>(&mut Chunk { c, unit_mm: UNIT_MM, measured: &measured, out: &mut out });
        check(false, &out, corrected);
    }
}
