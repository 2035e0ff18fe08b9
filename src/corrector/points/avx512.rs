//! [`super::from_steps`] by AVX-512's own instructions.

use std::arch::x86_64::{__m512, _CMP_NGT_UQ, _CMP_ORD_Q};

use pulp::cast;
use pulp::x86::V4;

use super::{FromSteps, from_steps};
use crate::corrector::cubics::Cubic;
use crate::corrector::moebius::NEAREST_POLE;
use crate::corrector::simd::{Isa, LANES};

/// Places of the pixels of a block from the middle of a cubic's.
const FROM_MIDDLE: [f32; LANES] = {
    let mut places = [0.0; LANES];
    let mut i = 0;
    while i < LANES {
        places[i] = i as f32 - (LANES - 1) as f32;
        i += 1;
    }
    places
};

/// Points while depth is in registers, corrected or as it is.
#[inline(always)]
pub(in crate::corrector) fn points<const CORRECT: bool>(v4: V4, from: FromSteps<'_>) -> Option<usize> {
    let f = v4.avx512f;
    let FromSteps { map, measured, unit_mm, rays: [rx, ry], cubics, out } = from;
    let n = measured.len();
    if n < LANES {
        return from_steps::<_, CORRECT>(v4, FromSteps { map, measured, unit_mm, rays: [rx, ry], cubics, out });
    }
    let (p, [dx, dy, dz]) = map;
    let splat = |value: f32| f._mm512_set1_ps(value);
    let (p, unit, nan, one, pole) = (splat(p), splat(unit_mm), splat(f32::NAN), splat(1.0), splat(NEAREST_POLE));
    let d = [splat(dx), splat(dy), splat(dz)];

    // The first block ends, and the last begins, within another one, so that all stores but theirs are on lines of the cache:
    // a pixel has three values, a line sixteen, and 3 · 11 is 1 beyond two lines.
    let head = (out.as_ptr().align_offset(64) * 11) % LANES;
    let t = f._mm512_add_ps(cast(FROM_MIDDLE), splat(head as f32));
    let cubic = |c: &Cubic| {
        let [c0, c1, c2, c3] = c.map(splat);
        f._mm512_fmadd_ps(f._mm512_fmadd_ps(f._mm512_fmadd_ps(c3, t, c2), t, c1), t, c0)
    };
    let (mut depths, mut lost) = (0, 0);
    let (mut at, mut done) = (0, 0);
    while done < n {
        let (Some(steps), Some(x), Some(y), Some([of_x, of_y]), Some(out)) = (
            measured[at..].first_chunk::<LANES>(),
            rx[at..].first_chunk::<LANES>(),
            ry[at..].first_chunk::<LANES>(),
            cubics.get(at / LANES),
            out[3 * at..].first_chunk_mut::<{ 3 * LANES }>(),
        ) else {
            return None;
        };
        let steps = f._mm512_cvtepu16_epi32(cast(*steps));
        let valid = f._mm512_test_epi32_mask(steps, steps);
        let z = f._mm512_mul_ps(f._mm512_cvtepi32_ps(steps), unit);
        let (rx, ry): (__m512, __m512) = if at % LANES == head && !of_x[0].is_nan() {
            (cubic(of_x), cubic(of_y))
        } else {
            (cast(*x), cast(*y))
        };
        let depth = if CORRECT {
            let r = f._mm512_fmadd_ps(d[0], rx, f._mm512_fmadd_ps(d[1], ry, d[2]));
            let left = f._mm512_fnmadd_ps(r, z, one);
            let sum = f._mm512_mul_ps(z, f._mm512_fmadd_ps(r, z, p));
            let inverse = f._mm512_rcp14_ps(left);
            let quotient = f._mm512_mul_ps(sum, inverse);
            let change = f._mm512_fmadd_ps(f._mm512_fnmadd_ps(left, quotient, sum), inverse, quotient);
            let corrected = f._mm512_add_ps(z, change);
            lost |= valid & f._mm512_cmp_ps_mask::<_CMP_NGT_UQ>(left, pole);
            lost |= valid & f._mm512_cmp_ps_mask::<_CMP_NGT_UQ>(corrected, splat(0.0));
            f._mm512_mask_blend_ps(valid, nan, corrected)
        } else {
            f._mm512_mask_blend_ps(valid & f._mm512_cmp_ps_mask::<_CMP_ORD_Q>(rx, rx), nan, z)
        };
        // What the block before has done already is not counted twice.
        depths += (valid >> (done - at)).count_ones() as usize;
        let (x, y) = (f._mm512_mul_ps(rx, depth), f._mm512_mul_ps(ry, depth));
        v4.interleave(&cast(x), &cast(y), &cast(depth), out);
        done = at + LANES;
        at = if at == 0 && head > 0 { head } else { done }.min(n - LANES);
    }
    (lost == 0).then_some(depths)
}
