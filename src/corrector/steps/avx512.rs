//! [`super::in_single`] by AVX-512's own instructions, 32 pixels at a time: one reading of the frame, and a quotient from the
//! processor's estimate of 1/b.

use std::arch::x86_64::{__m256i, __m512, __m512i};

use pulp::cast;
use pulp::x86::V4;

use super::{Chunk, Seen, in_single};

/// Pixels of a block, and of each of its halves.
const BLOCK: usize = 32;
const HALF: usize = 16;

/// Packing takes from both halves in turns of 64 bits.
const IN_ORDER: [u64; 8] = [0, 2, 4, 6, 1, 3, 5, 7];

/// Corrects and rounds. `WHOLE`: all that is valid stays so.
#[inline(always)]
pub(in crate::corrector) fn steps<const P: bool, const Q: bool, const R: bool, const WHOLE: bool>(
    v4: V4,
    chunk: &mut Chunk<'_>,
) -> Seen {
    let (f, bw) = (v4.avx512f, v4.avx512bw);
    let Chunk { c, unit_mm, measured, ref mut out } = *chunk;
    let (blocks, rest) = measured.as_chunks::<BLOCK>();
    let (out_blocks, out_rest) = out.as_chunks_mut::<BLOCK>();
    let tables = Tables {
        p: if P { &halves(c.p)[..blocks.len()] } else { &[] },
        q: if Q { &halves(c.q)[..blocks.len()] } else { &[] },
        r: if R { &halves(c.r)[..blocks.len()] } else { &[] },
    };
    let splat = |value: f32| f._mm512_set1_ps(value);
    let (p0, unit, per_mm) = (splat(c.p0), splat(unit_mm as f32), splat((1.0 / unit_mm) as f32));
    let (one, half, zero) = (splat(1.0), splat(0.5), splat(0.0));
    let in_order: __m512i = cast(IN_ORDER);

    let mut most = f._mm512_setzero_si512();
    let (mut depths, mut corrected) = (0, 0);
    for (b, (measured, out)) in blocks.iter().zip(out_blocks).enumerate() {
        let depth: [__m256i; 2] = cast(*measured);
        let mut changes = [f._mm512_setzero_si512(); 2];
        let mut stays = [0; 2];
        for h in 0..2 {
            let steps = f._mm512_cvtepi32_ps(f._mm512_cvtepu16_epi32(depth[h]));
            let z = f._mm512_mul_ps(steps, unit);
            let p = if P { cast(tables.p[b][h]) } else { p0 };
            let r: __m512 = if R { cast(tables.r[b][h]) } else { zero };
            let slope = if R { f._mm512_fmadd_ps(r, z, p) } else { p };
            let sum = if Q {
                f._mm512_fmadd_ps(steps, slope, f._mm512_mul_ps(cast(tables.q[b][h]), per_mm))
            } else {
                f._mm512_mul_ps(steps, slope)
            };
            let left = if R { f._mm512_fnmadd_ps(r, z, one) } else { one };
            let change = if R {
                // The estimate is right to 2⁻¹⁴; what the quotient leaves squares that.
                let inverse = f._mm512_rcp14_ps(left);
                let quotient = f._mm512_mul_ps(sum, inverse);
                f._mm512_fmadd_ps(f._mm512_fnmadd_ps(left, quotient, sum), inverse, quotient)
            } else {
                sum
            };
            if !WHOLE {
                let before_pole = if R { f._mm512_cmp_ps_mask::<GREATER>(left, zero) } else { u16::MAX };
                let above = if Q {
                    let valid = f._mm512_cmp_ps_mask::<GREATER>(steps, zero);
                    valid & f._mm512_cmp_ps_mask::<GREATER>(f._mm512_add_ps(steps, change), half)
                } else {
                    u16::MAX
                };
                stays[h] = before_pole & above;
            }
            changes[h] = f._mm512_cvtps_epi32(change);
        }
        let change = f._mm512_permutexvar_epi64(in_order, bw._mm512_packs_epi32(changes[0], changes[1]));
        let measured: __m512i = cast(*measured);
        let sum = bw._mm512_add_epi16(measured, change);
        most = bw._mm512_max_epu16(most, measured);
        // The bits of a mask are counted beside the vectors.
        depths += bw._mm512_test_epi16_mask(measured, measured).count_ones() as usize;
        if WHOLE {
            *out = cast(sum);
        } else {
            let sum = bw._mm512_maskz_mov_epi16(u32::from(stays[0]) | u32::from(stays[1]) << HALF, sum);
            corrected += bw._mm512_test_epi16_mask(sum, sum).count_ones() as usize;
            *out = cast(sum);
        }
    }
    let most: [u16; BLOCK] = cast(most);
    let at = blocks.len() * BLOCK;
    let c = c.part(at, rest.len());
    let seen = in_single::<_, P, Q, R, WHOLE>(v4, &mut Chunk { c, unit_mm, measured: rest, out: out_rest });
    let corrected = if WHOLE { depths } else { corrected };
    Seen {
        most: most.into_iter().fold(seen.most, u16::max),
        depths: depths + seen.depths,
        corrected: corrected + seen.corrected,
    }
}

#[inline(always)]
fn halves(table: &[f32]) -> &[[[f32; HALF]; 2]] {
    table.as_chunks().0.as_chunks().0
}

/// Ordered, signalling no exception on NaN.
const GREATER: i32 = std::arch::x86_64::_CMP_GT_OQ;

/// The coefficients of blocks, where they are tables.
struct Tables<'a> {
    p: &'a [[[f32; HALF]; 2]],
    q: &'a [[[f32; HALF]; 2]],
    r: &'a [[[f32; HALF]; 2]],
}
