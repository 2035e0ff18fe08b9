//! Points from 16-bit depth by AVX-512's own instructions, sixteen pixels at a time.

use std::arch::x86_64::{__m512, _CMP_NGT_UQ, _CMP_UNORD_Q};

use pulp::cast;
use pulp::x86::V4;

use super::portable::{self, DepthOnRays, PointCounts};
use crate::plan::NEAREST_POLE;
use crate::rays::{Cubic, PLACES};
use crate::simd::{Isa, LANES, LINE};

/// 0, 1, … 15.
const LANE_INDICES: [u32; LANES] = {
    let mut indices = [0; LANES];
    let mut i = 0;
    while i < LANES {
        indices[i] = i as u32;
        i += 1;
    }
    indices
};

/// A Möbius map of depth with q = 0, z = (1 + p) z_m / (1 − r z_m), by the constants of all lanes. Without CORRECT it only
/// scales.
#[derive(Clone, Copy)]
struct DepthMap<const CORRECT: bool> {
    v4: V4,
    /// mm per step, times 1 + p.
    scale: __m512,
    /// r per step, over the rays.
    d: [__m512; 3],
    one: __m512,
    nan: __m512,
}

impl<const CORRECT: bool> DepthMap<CORRECT> {
    #[inline(always)]
    fn new(v4: V4, (p, d): (f32, [f32; 3]), unit_mm: f32) -> Self {
        let splat = |value: f32| v4.avx512f._mm512_set1_ps(value);
        let scale = splat(if CORRECT { (1.0 + p) * unit_mm } else { unit_mm });
        Self { v4, scale, d: d.map(|d| splat(d * unit_mm)), one: splat(1.0), nan: splat(f32::NAN) }
    }

    /// Depth at `valid` lanes, mm, NaN at the others, of `steps`, 0 where there is no measurement. `nearest_pole` becomes the
    /// smaller of itself and 1 − r z_m.
    #[inline(always)]
    fn depth(&self, steps: __m512, [rx, ry]: [__m512; 2], valid: u16, nearest_pole: &mut __m512) -> __m512 {
        let Self { scale, d, one, nan, .. } = *self;
        let f = self.v4.avx512f;
        if !CORRECT {
            return f._mm512_mask_mul_ps(nan, valid, steps, scale);
        }
        let r = f._mm512_fmadd_ps(d[0], rx, f._mm512_fmadd_ps(d[1], ry, d[2]));
        // `left` is 1 where there is no depth. The minimum of NaN and a number is the number.
        let left = f._mm512_fnmadd_ps(r, steps, one);
        *nearest_pole = f._mm512_min_ps(left, *nearest_pole);
        // The estimate of 1/left has an error of 2⁻¹⁴, which a Newton step squares.
        let inverse = f._mm512_rcp14_ps(left);
        let inverse = f._mm512_fmadd_ps(f._mm512_fnmadd_ps(left, inverse, one), inverse, inverse);
        f._mm512_mask_mul_ps(nan, valid, f._mm512_mul_ps(steps, scale), inverse)
    }
}

/// [`portable::from_u16`] in AVX-512's own instructions.
///
/// Computed as [`DepthMap`] does it, depth itself is rounded three times, some 0.001 mm at 5 m.
#[inline(always)]
pub(crate) fn from_u16<const CORRECT: bool>(v4: V4, pixels: DepthOnRays<'_>) -> Option<PointCounts> {
    let f = v4.avx512f;
    if pixels.measured.len() < LANES {
        return portable::from_u16::<_, CORRECT>(v4, pixels);
    }
    let DepthOnRays { map, measured, unit_mm, rays: [rx, ry], cubics, out } = pixels;
    if CORRECT && map.0 <= -1.0 {
        return None;
    }
    let splat = |value: f32| f._mm512_set1_ps(value);
    let depth_map = DepthMap::<CORRECT>::new(v4, map, unit_mm);
    let (one_step, no_measurement) = (f._mm512_set1_epi32(1), f._mm512_set1_epi32(i32::from(u16::MAX) - 1));

    let places: __m512 = cast(PLACES);
    let cubic = |c: &Cubic| {
        let [c0, c1, c2, c3] = c.map(splat);
        let slope = f._mm512_fmadd_ps(f._mm512_fmadd_ps(c3, places, c2), places, c1);
        f._mm512_fmadd_ps(slope, places, c0)
    };

    // Points are stored as whole cache lines. `head` is the number of pixels before the first point that begins at a
    // line: a point has three values, a line has sixteen, and 3 · 11 = 1 modulo 16. From there on, sixteen points fill
    // three lines; they come from two neighbouring blocks.
    let head = (out.as_ptr().align_offset(LINE) * 11) % LANES;
    let shift = f._mm512_add_epi32(cast(LANE_INDICES), f._mm512_set1_epi32(head as i32));
    let (steps_blocks, steps_rest) = measured.as_chunks::<LANES>();
    let (x_blocks, x_rest) = rx.as_chunks::<LANES>();
    let (y_blocks, y_rest) = ry.as_chunks::<LANES>();
    let blocks = steps_blocks.len();
    let (x_blocks, y_blocks, block_cubics) = (&x_blocks[..blocks], &y_blocks[..blocks], &cubics[..blocks]);

    let mut nearest_pole = depth_map.one;
    let (mut depths, mut without_ray) = (0, 0);
    let mut before = [depth_map.nan; 3];
    let (first, out) = out.split_at_mut(3 * head);
    let (whole, out) = out.split_at_mut(3 * LANES * (blocks - 1));
    let (last, remainder) = out.split_at_mut(3 * (LANES - head));
    let mut lines = whole.as_chunks_mut::<{ 3 * LANES }>().0.iter_mut();
    let mut one_block = [0.0; 3 * LANES];
    for b in 0..blocks {
        let steps = f._mm512_cvtepu16_epi32(cast(steps_blocks[b]));
        // A depth of 0 wraps: what is left are the depths from 1 to the largest but one, all that are measurements.
        let measured = f._mm512_cmplt_epu32_mask(f._mm512_sub_epi32(steps, one_step), no_measurement);
        let mut valid = measured;
        depths += valid.count_ones() as usize;
        let [of_x, of_y] = &block_cubics[b];
        let (rx, ry): (__m512, __m512) = if of_x[0].is_nan() {
            let (rx, ry) = (cast(x_blocks[b]), cast(y_blocks[b]));
            let lost = f._mm512_cmp_ps_mask::<_CMP_UNORD_Q>(rx, rx);
            without_ray += (valid & lost).count_ones() as usize;
            valid &= !lost;
            (rx, ry)
        } else {
            (cubic(of_x), cubic(of_y))
        };
        let steps = f._mm512_maskz_cvtepi32_ps(measured, steps);
        let depth = depth_map.depth(steps, [rx, ry], valid, &mut nearest_pole);
        let point = [f._mm512_mul_ps(rx, depth), f._mm512_mul_ps(ry, depth), depth];
        if b == 0 {
            v4.interleave(&cast(point[0]), &cast(point[1]), &cast(point[2]), &mut one_block);
            first.copy_from_slice(&one_block[..3 * head]);
        } else if let Some(line) = lines.next() {
            let x = f._mm512_permutex2var_ps(before[0], shift, point[0]);
            let y = f._mm512_permutex2var_ps(before[1], shift, point[1]);
            let depth = f._mm512_permutex2var_ps(before[2], shift, point[2]);
            v4.interleave(&cast(x), &cast(y), &cast(depth), line);
        }
        before = point;
    }
    v4.interleave(&cast(before[0]), &cast(before[1]), &cast(before[2]), &mut one_block);
    last.copy_from_slice(&one_block[3 * head..]);
    let usable = !CORRECT || f._mm512_cmp_ps_mask::<_CMP_NGT_UQ>(nearest_pole, splat(NEAREST_POLE)) == 0;
    if !usable {
        return None;
    }
    let rays = [x_rest, y_rest];
    let of_rest = DepthOnRays { map, measured: steps_rest, unit_mm, rays, cubics: &[], out: remainder };
    let of_rest = portable::from_u16::<_, CORRECT>(v4, of_rest)?;
    Some(PointCounts { depths: depths + of_rest.depths, points: depths - without_ray + of_rest.points })
}
