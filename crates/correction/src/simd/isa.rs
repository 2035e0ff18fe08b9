//! Operations that differ between instruction sets.

#[cfg(target_arch = "x86_64")]
use pulp::x86::V4;

use super::count::{count_measured, measurement};

/// Pixels that [`Isa::interleave`] takes at a time.
pub(crate) const LANES: usize = 16;

/// An instruction set, as far as kernels need to know it.
pub(crate) trait Isa: Copy {
    /// Whether a b + c is one instruction. Where it is not, `f32::mul_add` is a function call that costs more than the
    /// rest of a loop.
    const FMA: bool;

    /// a b + c, rounded once where the instruction set can.
    #[inline(always)]
    fn mul_add(self, a: f32, b: f32, c: f32) -> f32 {
        if Self::FMA { a.mul_add(b, c) } else { a * b + c }
    }

    /// a / b to within an ulp, for b > 0. The result for b ≤ 0 is unspecified.
    ///
    /// The division instruction would take longer than everything else done to a pixel. Instead, 1/b is estimated from
    /// the bits of b (5 %) and refined by a step of third order (0.01 %); a step of second order refines the quotient.
    #[inline(always)]
    fn divide(self, a: f32, b: f32) -> f32 {
        if !Self::FMA {
            return a / b;
        }
        let about = f32::from_bits(0x7ef3_11c7_u32.wrapping_sub(b.to_bits()));
        let missing = self.mul_add(-b, about, 1.0);
        let inverse = self.mul_add(about, self.mul_add(missing, missing, missing), about);
        let quotient = a * inverse;
        self.mul_add(self.mul_add(-b, quotient, a), inverse, quotient)
    }

    /// The largest measured depth, and the number of measured depths.
    #[inline(always)]
    fn max_and_count(self, values: &[u16]) -> (u16, usize) {
        (values.iter().fold(0, |most, value| measurement(*value).max(most)), count_measured(values))
    }

    /// x0 y0 z0 x1 y1 z1 … from sixteen of each.
    #[inline(always)]
    fn interleave(self, x: &[f32; LANES], y: &[f32; LANES], z: &[f32; LANES], out: &mut [f32; 3 * LANES]) {
        for i in 0..LANES {
            out[3 * i] = x[i];
            out[3 * i + 1] = y[i];
            out[3 * i + 2] = z[i];
        }
    }

    /// Runs the version of a kernel that is fastest on this instruction set.
    #[inline(always)]
    fn specialised<K: Specialised>(self, kernel: K) -> K::Output {
        kernel.portable(self)
    }
}

/// A kernel with a version of its own for AVX-512. Both versions must be `#[inline(always)]`, as [`Kernel::run`] must.
///
/// [`Kernel::run`]: super::Kernel::run
pub(crate) trait Specialised {
    type Output;

    /// The kernel as plain loops, for every instruction set.
    fn portable<I: Isa>(self, isa: I) -> Self::Output;

    /// The kernel in AVX-512's own instructions.
    #[cfg(target_arch = "x86_64")]
    fn avx512(self, v4: V4) -> Self::Output;
}

/// An instruction set with no operations of its own; `FMA` says whether it has a fused multiply-add.
#[derive(Clone, Copy)]
pub(crate) struct Portable<const FMA: bool>;

impl<const FMA: bool> Isa for Portable<FMA> {
    const FMA: bool = FMA;
}
