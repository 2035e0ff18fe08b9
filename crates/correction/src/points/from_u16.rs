//! Points from 16-bit depth, by the version of the loop that is fastest on the present instruction set.

#[cfg(target_arch = "x86_64")]
use pulp::x86::V4;

#[cfg(target_arch = "x86_64")]
use super::avx512;
use super::portable::{self, DepthOnRays, PointCounts};
use crate::simd::{Isa, Specialised};

struct FromU16<'a, const CORRECT: bool>(DepthOnRays<'a>);

impl<const CORRECT: bool> Specialised for FromU16<'_, CORRECT> {
    type Output = Option<PointCounts>;

    #[inline(always)]
    fn portable<I: Isa>(self, isa: I) -> Option<PointCounts> {
        portable::from_u16::<I, CORRECT>(isa, self.0)
    }

    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    fn avx512(self, v4: V4) -> Option<PointCounts> {
        avx512::from_u16::<CORRECT>(v4, self.0)
    }
}

/// Computes points from 16-bit depth, which is corrected first if CORRECT. `None`, with unspecified output, where f32
/// is not precise enough for a pixel.
#[inline(always)]
pub(crate) fn from_u16<I: Isa, const CORRECT: bool>(isa: I, pixels: DepthOnRays<'_>) -> Option<PointCounts> {
    isa.specialised(FromU16::<CORRECT>(pixels))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::{Kernel, LANES, Portable, dispatch};

    const UNIT_MM: f32 = 0.5;

    /// A frame whose points are computed in every version of the loop.
    #[derive(Clone, Copy)]
    struct Frame<'a, const CORRECT: bool> {
        map: (f32, [f32; 3]),
        measured: &'a [u16],
        rays: [&'a [f32]; 2],
    }

    impl<const CORRECT: bool> Kernel for Frame<'_, CORRECT> {
        type Output = Option<(PointCounts, Vec<f32>)>;

        #[inline(always)]
        fn run<I: Isa>(self, isa: I) -> Self::Output {
            let n = self.measured.len();
            let mut out = vec![7.0; 3 * n];
            // None of the cubics is accurate, so that the rays are used.
            let cubics = vec![[[f32::NAN; 4]; 2]; n.div_ceil(LANES)];
            let Self { map, measured, rays } = self;
            let pixels = DepthOnRays { map, measured, unit_mm: UNIT_MM, rays, cubics: &cubics, out: &mut out };
            let counts = from_u16::<I, CORRECT>(isa, pixels)?;
            Some((counts, out))
        }
    }

    impl<const CORRECT: bool> Frame<'_, CORRECT> {
        /// By the plain loop without and with fused multiplication, and by the version for the machine.
        fn results(self) -> [Option<(PointCounts, Vec<f32>)>; 3] {
            [self.run(Portable::<false>), self.run(Portable::<true>), dispatch(self)]
        }
    }

    /// Depth with gaps, and rays some of which are missing.
    fn depth_and_rays(n: usize) -> (Vec<u16>, [Vec<f32>; 2]) {
        let steps = |i: usize| match i % 5 {
            0 => 0,
            1 => u16::MAX,
            2 => 1,
            3 => u16::MAX - 1,
            _ => (i * 977 % 9000) as u16,
        };
        let wave = |i: usize, k: f32| if i % 11 == 6 { f32::NAN } else { (k * i as f32).sin() };
        ((0..n).map(steps).collect(), [0.71, 0.37].map(|k| (0..n).map(|i| wave(i, k)).collect()))
    }

    fn points_of<const CORRECT: bool>(n: usize) {
        let (measured, rays) = depth_and_rays(n);
        let (p, d) = if CORRECT { (0.02, [3e-6, -2e-6, 1e-6]) } else { (0.0, [0.0; 3]) };
        let frame = Frame::<CORRECT> { map: (p, d), measured: &measured, rays: [&rays[0], &rays[1]] };
        let has_depth = |i: usize| measured[i] > 0 && measured[i] < u16::MAX;
        let depths = (0..n).filter(|i| has_depth(*i)).count();
        let points = (0..n).filter(|i| has_depth(*i) && !rays[0][*i].is_nan()).count();
        for result in frame.results() {
            let (counts, out) = result.unwrap();
            assert_eq!(counts, PointCounts { depths, points }, "{n} pixels");
            for i in 0..n {
                let [x, y] = [rays[0][i], rays[1][i]].map(f64::from);
                let z = f64::from(measured[i]) * f64::from(UNIT_MM);
                let r = f64::from(d[0]) * x + f64::from(d[1]) * y + f64::from(d[2]);
                let z = (1.0 + f64::from(p)) * z / (1.0 - r * z);
                for (coordinate, expected) in out[3 * i..3 * i + 3].iter().zip([x * z, y * z, z]) {
                    let near = (f64::from(*coordinate) - expected).abs() <= 1e-6 * z;
                    let right = if has_depth(i) && !x.is_nan() { near } else { coordinate.is_nan() };
                    assert!(right, "pixel {i} of {n}: {coordinate} instead of {expected}");
                }
            }
        }
    }

    #[test]
    fn every_instruction_set_counts_and_places_points_alike() {
        for n in [1, 5, LANES, LANES + 7, 5 * LANES, 5 * LANES + 1] {
            points_of::<true>(n);
            points_of::<false>(n);
        }
    }

    /// A depth at or beyond the pole of its map is left to f64, wherever in a chunk its pixel is; a pixel without depth has no
    /// pole.
    #[test]
    fn poles_are_noticed_at_every_pixel() {
        let n = 3 * LANES + 5;
        for place in 0..n {
            // r is 1e-3 / mm at one pixel and zero elsewhere.
            let x: Vec<f32> = (0..n).map(|i| if i == place { 1.0 } else { 0.0 }).collect();
            let y = vec![0.0; n];
            for (steps, usable) in [(1900, true), (2000, false), (2400, false), (0, true), (u16::MAX, true)] {
                let measured: Vec<u16> = (0..n).map(|i| if i == place { steps } else { 3000 }).collect();
                let frame = Frame::<true> { map: (0.0, [1e-3, 0.0, 0.0]), measured: &measured, rays: [&x, &y] };
                for result in frame.results() {
                    assert_eq!(result.is_some(), usable, "pixel {place}: {steps} steps");
                }
            }
        }
    }
}
