//! Correction of a chunk in f32 by AVX-512's own instructions, 32 pixels at a time.
//!
//! The frame is read once, for correction and counts together, and quotients are computed from the processor's estimate
//! of 1/b.

use std::arch::x86_64::{__m256i, __m512, __m512i};

use pulp::cast;
use pulp::x86::V4;

use super::chunk::{self, Chunk, PassCounts};
use crate::plan::Coefficients;
use crate::simd::LINE;

/// Pixels of a block and of half a block.
const BLOCK: usize = 32;
const HALF: usize = 16;

/// Order of 64-bit groups that undoes the packing of two halves, which takes from both in turns.
const IN_ORDER: [u64; 8] = [0, 2, 4, 6, 1, 3, 5, 7];

/// [`chunk::in_single`] in AVX-512's own instructions.
#[inline(always)]
pub(crate) fn in_single<const P: bool, const Q: bool, const R: bool, const KEEPS_VALID: bool>(
    v4: V4,
    chunk: &mut Chunk<'_>,
) -> PassCounts {
    let Chunk { c, unit_mm, measured, .. } = *chunk;
    let n = measured.len();
    if n < BLOCK {
        return chunk::in_single::<_, P, Q, R, KEEPS_VALID>(v4, chunk);
    }
    let mut pass = Pass::<P, Q, R, KEEPS_VALID> {
        v4,
        p0: v4.avx512f._mm512_set1_ps(c.p0),
        unit: v4.avx512f._mm512_set1_ps(unit_mm as f32),
        per_mm: v4.avx512f._mm512_set1_ps((1.0 / unit_mm) as f32),
        most: v4.avx512f._mm512_setzero_si512(),
        depths: 0,
        corrected: 0,
    };
    // The blocks in the middle begin at a cache line, so that their stores fill whole lines. The first and the last
    // block overlap them; pixels in an overlap are counted once.
    let head = chunk.out.as_ptr().align_offset(LINE) % BLOCK;
    let whole = (n - head) / BLOCK * BLOCK;
    let remaining = n - head - whole;
    let out = &mut *chunk.out;
    if head > 0 {
        pass.blocks(c.part(0, BLOCK), &measured[..BLOCK], &mut out[..BLOCK], u32::MAX >> (BLOCK - head));
    }
    pass.blocks(c.part(head, whole), &measured[head..head + whole], &mut out[head..head + whole], u32::MAX);
    if remaining > 0 {
        let from = n - BLOCK;
        pass.blocks(c.part(from, BLOCK), &measured[from..], &mut out[from..n], u32::MAX << (BLOCK - remaining));
    }
    let most: [u16; BLOCK] = cast(pass.most);
    let corrected = if KEEPS_VALID { pass.depths } else { pass.corrected };
    PassCounts { most: most.into_iter().fold(0, u16::max), depths: pass.depths, corrected }
}

/// Constants of all blocks, and the counts so far.
struct Pass<const P: bool, const Q: bool, const R: bool, const KEEPS_VALID: bool> {
    v4: V4,
    p0: __m512,
    unit: __m512,
    per_mm: __m512,
    most: __m512i,
    depths: usize,
    corrected: usize,
}

impl<const P: bool, const Q: bool, const R: bool, const KEEPS_VALID: bool> Pass<P, Q, R, KEEPS_VALID> {
    /// Corrects a whole number of blocks; `counted` is the mask of pixels of each block that are counted.
    #[inline(always)]
    fn blocks(&mut self, c: Coefficients<'_>, measured: &[u16], out: &mut [u16], counted: u32) {
        let (f, bw) = (self.v4.avx512f, self.v4.avx512bw);
        let blocks = measured.as_chunks::<BLOCK>().0;
        let (p, q, r) = (
            if P { &halves(c.p)[..blocks.len()] } else { &[] },
            if Q { &halves(c.q)[..blocks.len()] } else { &[] },
            if R { &halves(c.r)[..blocks.len()] } else { &[] },
        );
        let (unit, per_mm) = (self.unit, self.per_mm);
        let (one, half, zero) = (f._mm512_set1_ps(1.0), f._mm512_set1_ps(0.5), f._mm512_set1_ps(0.0));
        let in_order: __m512i = cast(IN_ORDER);
        let one_step: __m512i = cast([1u16; BLOCK]);
        let (mut most, mut depths, mut corrected) = (self.most, 0, 0);
        for (b, (measured, out)) in blocks.iter().zip(out.as_chunks_mut::<BLOCK>().0).enumerate() {
            // As `simd::measurement`.
            let measured = bw._mm512_subs_epu16(bw._mm512_add_epi16(cast(*measured), one_step), one_step);
            let depth: [__m256i; 2] = cast(measured);
            let mut changes = [f._mm512_setzero_si512(); 2];
            let mut keeps = [0; 2];
            for h in 0..2 {
                let steps = f._mm512_cvtepi32_ps(f._mm512_cvtepu16_epi32(depth[h]));
                let z = f._mm512_mul_ps(steps, unit);
                let p = if P { cast(p[b][h]) } else { self.p0 };
                let r: __m512 = if R { cast(r[b][h]) } else { zero };
                let slope = if R { f._mm512_fmadd_ps(r, z, p) } else { p };
                let sum = if Q {
                    f._mm512_fmadd_ps(steps, slope, f._mm512_mul_ps(cast(q[b][h]), per_mm))
                } else {
                    f._mm512_mul_ps(steps, slope)
                };
                let left = if R { f._mm512_fnmadd_ps(r, z, one) } else { one };
                let change = if R {
                    // The estimate of 1/left has an error of 2⁻¹⁴, which one refinement of the quotient squares.
                    let inverse = f._mm512_rcp14_ps(left);
                    let quotient = f._mm512_mul_ps(sum, inverse);
                    f._mm512_fmadd_ps(f._mm512_fnmadd_ps(left, quotient, sum), inverse, quotient)
                } else {
                    sum
                };
                if !KEEPS_VALID {
                    let before_pole = if R { f._mm512_cmp_ps_mask::<GREATER>(left, zero) } else { u16::MAX };
                    let above = if Q {
                        let valid = f._mm512_cmp_ps_mask::<GREATER>(steps, zero);
                        valid & f._mm512_cmp_ps_mask::<GREATER>(f._mm512_add_ps(steps, change), half)
                    } else {
                        u16::MAX
                    };
                    keeps[h] = before_pole & above;
                }
                changes[h] = f._mm512_cvtps_epi32(change);
            }
            let change = f._mm512_permutexvar_epi64(in_order, bw._mm512_packs_epi32(changes[0], changes[1]));
            let mut sum = bw._mm512_add_epi16(measured, change);
            most = bw._mm512_max_epu16(most, measured);
            // Counting the bits of a mask runs on the scalar units, in parallel with the vectors.
            depths += (bw._mm512_test_epi16_mask(measured, measured) & counted).count_ones() as usize;
            if !KEEPS_VALID {
                sum = bw._mm512_maskz_mov_epi16(u32::from(keeps[0]) | u32::from(keeps[1]) << HALF, sum);
                corrected += (bw._mm512_test_epi16_mask(sum, sum) & counted).count_ones() as usize;
            }
            *out = cast(sum);
        }
        self.most = most;
        self.depths += depths;
        self.corrected += corrected;
    }
}

#[inline(always)]
fn halves(table: &[f32]) -> &[[[f32; HALF]; 2]] {
    table.as_chunks().0.as_chunks().0
}

/// The comparison a > b, false for NaN, which raises no exception.
const GREATER: i32 = std::arch::x86_64::_CMP_GT_OQ;
