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
    let n = measured.len();
    if n < BLOCK {
        return in_single::<_, P, Q, R, WHOLE>(v4, chunk);
    }
    let splat = |value: f32| f._mm512_set1_ps(value);
    let (p0, unit, per_mm) = (splat(c.p0), splat(unit_mm as f32), splat((1.0 / unit_mm) as f32));
    let (one, half, zero) = (splat(1.0), splat(0.5), splat(0.0));
    let in_order: __m512i = cast(IN_ORDER);

    let mut most = f._mm512_setzero_si512();
    let (mut depths, mut corrected) = (0, 0);
    // The first block ends, and the last begins, within another one, so that all stores but theirs are whole lines of the cache.
    let head = out.as_ptr().align_offset(64) % BLOCK;
    let (mut at, mut done) = (0, 0);
    while done < n {
        let (Some(measured), Some(out), Some(p), Some(q), Some(r)) = (
            measured[at..].first_chunk::<BLOCK>(),
            out[at..].first_chunk_mut::<BLOCK>(),
            block::<P>(c.p, at),
            block::<Q>(c.q, at),
            block::<R>(c.r, at),
        ) else {
            break;
        };
        let depth: [__m256i; 2] = cast(*measured);
        let mut changes = [f._mm512_setzero_si512(); 2];
        let mut stays = [0; 2];
        for h in 0..2 {
            let steps = f._mm512_cvtepi32_ps(f._mm512_cvtepu16_epi32(depth[h]));
            let z = f._mm512_mul_ps(steps, unit);
            let p = if P { cast(p[h]) } else { p0 };
            let r: __m512 = if R { cast(r[h]) } else { zero };
            let slope = if R { f._mm512_fmadd_ps(r, z, p) } else { p };
            let sum = if Q {
                f._mm512_fmadd_ps(steps, slope, f._mm512_mul_ps(cast(q[h]), per_mm))
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
        // The bits of a mask are counted beside the vectors; what the block before has done already is not counted twice.
        let own = |mask: u32| (mask >> (done - at)).count_ones() as usize;
        depths += own(bw._mm512_test_epi16_mask(measured, measured));
        if WHOLE {
            *out = cast(sum);
        } else {
            let sum = bw._mm512_maskz_mov_epi16(u32::from(stays[0]) | u32::from(stays[1]) << HALF, sum);
            corrected += own(bw._mm512_test_epi16_mask(sum, sum));
            *out = cast(sum);
        }
        done = at + BLOCK;
        at = if at == 0 && head > 0 { head } else { done }.min(n - BLOCK);
    }
    let most: [u16; BLOCK] = cast(most);
    let corrected = if WHOLE { depths } else { corrected };
    Seen { most: most.into_iter().fold(0, u16::max), depths, corrected }
}

/// The coefficients of a block, where they are a table.
#[inline(always)]
fn block<const WANTED: bool>(table: &[f32], at: usize) -> Option<[[f32; HALF]; 2]> {
    if WANTED { table.get(at..)?.first_chunk::<BLOCK>().map(|block| cast(*block)) } else { Some([[0.0; HALF]; 2]) }
}

/// Ordered, signalling no exception on NaN.
const GREATER: i32 = std::arch::x86_64::_CMP_GT_OQ;
