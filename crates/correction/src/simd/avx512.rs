//! AVX-512, with 32 registers of sixteen f32.

use pulp::cast;
use pulp::x86::V4;

use super::isa::{Isa, LANES, Specialised};

/// For each third of the output, the lane that every value is taken from: of x (below [`LANES`]) and y (from there on).
const XY: [[u32; LANES]; 3] = indices(0);
/// For each third of the output, the lane of z that every value is taken from.
const Z: [[u32; LANES]; 3] = indices(1);
/// For each third of the output, a mask of the values that are taken from z.
const IS_Z: [u16; 3] = lanes_of_z();

const fn lanes_of_z() -> [u16; 3] {
    let mut masks = [0; 3];
    let mut e = 2;
    while e < 3 * LANES {
        masks[e / LANES] |= 1 << (e % LANES);
        e += 3;
    }
    masks
}

const fn indices(of_z: u32) -> [[u32; LANES]; 3] {
    let mut table = [[0; LANES]; 3];
    let mut e = 0;
    while e < 3 * LANES {
        let pixel = (e / 3) as u32;
        table[e / LANES][e % LANES] = if of_z == 0 && e % 3 == 1 { LANES as u32 + pixel } else { pixel };
        e += 1;
    }
    table
}

impl Isa for V4 {
    const FMA: bool = true;

    #[inline(always)]
    fn specialised<K: Specialised>(self, kernel: K) -> K::Output {
        kernel.avx512(self)
    }

    #[inline(always)]
    fn interleave(self, x: &[f32; LANES], y: &[f32; LANES], z: &[f32; LANES], out: &mut [f32; 3 * LANES]) {
        let (x, y, z) = (cast(*x), cast(*y), cast(*z));
        let f = self.avx512f;
        let (thirds, _) = out.as_chunks_mut::<LANES>();
        for (q, third) in thirds.iter_mut().enumerate() {
            let xy = f._mm512_permutex2var_ps(x, cast(XY[q]), y);
            *third = cast(f._mm512_mask_permutexvar_ps(xy, IS_Z[q], cast(Z[q]), z));
        }
    }
}
