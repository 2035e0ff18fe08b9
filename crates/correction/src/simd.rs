//! Loops compiled for the instruction set that the machine has.
//!
//! The kernels of this module are plain loops over slices. [`dispatch`] compiles them once for each instruction set that
//! pulp knows (AVX-512, AVX2 with FMA, NEON, the target's baseline) and picks one at run time; the compiler vectorises.
//! What it does not vectorise well is a method of [`Isa`].

use pulp::{Arch, Simd, WithSimd};

use super::formats::count_u16;
use super::points::{self, Found, FromSteps};
use super::steps::{self, Chunk, Seen};

/// Work to be compiled for every instruction set. `run` must be `#[inline(always)]`, and so must all that it calls in its
/// inner loops: only then do they take the caller's instruction set.
pub(super) trait Kernel {
    type Output;
    fn run<I: Isa>(self, isa: I) -> Self::Output;
}

/// What kernels know of the instruction set.
pub(super) trait Isa: Copy {
    /// Whether a b + c is one instruction; as a function call it would cost more than all the rest.
    const FMA: bool;

    /// a b + c.
    #[inline(always)]
    fn mul_add(self, a: f32, b: f32, c: f32) -> f32 {
        if Self::FMA { a.mul_add(b, c) } else { a * b + c }
    }

    /// a / b for b > 0, within an ulp; a b of another sign gives anything.
    ///
    /// The processor's division takes longer than all else that is done to a pixel. This starts from what the bits of b say
    /// of 1/b (5 %), and takes a step of third order (0.01 %) and one of second order at the quotient.
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

    /// The largest of some values, and how many are not 0.
    #[inline(always)]
    fn most_and_count(self, values: &[u16]) -> (u16, usize) {
        (values.iter().fold(0, |most, value| *value.max(&most)), count_u16(values))
    }

    /// [`steps::in_single`], in the instruction set's own way where that is quicker.
    #[inline(always)]
    fn steps<const P: bool, const Q: bool, const R: bool, const WHOLE: bool>(self, chunk: &mut Chunk<'_>) -> Seen {
        steps::in_single::<Self, P, Q, R, WHOLE>(self, chunk)
    }

    /// [`points::from_steps`], in the instruction set's own way where that is quicker.
    #[inline(always)]
    fn points<const CORRECT: bool>(self, from: FromSteps<'_>) -> Option<Found> {
        points::from_steps::<Self, CORRECT>(self, from)
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
}

/// Pixels that [`Isa::interleave`] takes at a time.
pub(super) const LANES: usize = 16;

#[derive(Clone, Copy)]
struct Portable<const FMA: bool>;

impl<const FMA: bool> Isa for Portable<FMA> {
    const FMA: bool = FMA;
}

#[cfg(target_arch = "x86_64")]
mod avx512 {
    use pulp::cast;
    use pulp::x86::V4;

    use super::super::points::{self, Found, FromSteps};
    use super::super::steps::{self, Chunk, Seen};
    use super::{Isa, LANES};

    /// Which lanes of (x, y) and of z go where, for each third of the output, and which lanes are z's.
    const XY: [[u32; LANES]; 3] = indices(0);
    const Z: [[u32; LANES]; 3] = indices(1);
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
        fn steps<const P: bool, const Q: bool, const R: bool, const WHOLE: bool>(self, chunk: &mut Chunk<'_>) -> Seen {
            steps::avx512::steps::<P, Q, R, WHOLE>(self, chunk)
        }

        #[inline(always)]
        fn points<const CORRECT: bool>(self, from: FromSteps<'_>) -> Option<Found> {
            points::avx512::points::<CORRECT>(self, from)
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
}

/// Runs a kernel compiled for this machine.
pub(super) fn dispatch<K: Kernel>(kernel: K) -> K::Output {
    struct Op<K>(K);
    impl<K: Kernel> WithSimd for Op<K> {
        type Output = K::Output;
        #[inline(always)]
        fn with_simd<S: Simd>(self, _: S) -> K::Output {
            if S::IS_SCALAR { self.0.run(Portable::<false>) } else { self.0.run(Portable::<true>) }
        }
    }
    #[cfg(target_arch = "x86_64")]
    if let Arch::V4(v4) = Arch::new() {
        struct OnV4<K>(pulp::x86::V4, K);
        impl<K: Kernel> pulp::NullaryFnOnce for OnV4<K> {
            type Output = K::Output;
            #[inline(always)]
            fn call(self) -> K::Output {
                self.1.run(self.0)
            }
        }
        return v4.vectorize(OnV4(v4, kernel));
    }
    Arch::new().dispatch(Op(kernel))
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Interleave([[f32; LANES]; 3]);

    impl Kernel for Interleave {
        type Output = [f32; 3 * LANES];
        fn run<I: Isa>(self, isa: I) -> Self::Output {
            let mut out = [0.0; 3 * LANES];
            isa.interleave(&self.0[0], &self.0[1], &self.0[2], &mut out);
            out
        }
    }

    #[test]
    fn every_instruction_set_interleaves_alike() {
        let xyz = std::array::from_fn(|k| std::array::from_fn(|i| (3 * i + k) as f32));
        let expected: [f32; 3 * LANES] = std::array::from_fn(|e| e as f32);
        assert_eq!(dispatch(Interleave(xyz)), expected);
        assert_eq!(Interleave(xyz).run(Portable::<false>), expected);
    }

    struct Divide<'a>(&'a [f32], &'a mut [f32]);

    impl Kernel for Divide<'_> {
        type Output = ();
        #[inline(always)]
        fn run<I: Isa>(self, isa: I) {
            for (b, out) in self.0.iter().zip(self.1) {
                *out = isa.divide(317.3, *b);
            }
        }
    }

    #[test]
    fn quotients_are_right_to_an_ulp() {
        let divisors: Vec<f32> = (0..400_000).map(|i| 1e-6 * 1.00008f32.powi(i)).collect();
        let (mut of_machine, mut portable) = (vec![0.0; divisors.len()], vec![0.0; divisors.len()]);
        dispatch(Divide(&divisors, &mut of_machine));
        Divide(&divisors, &mut portable).run(Portable::<true>);
        for ((b, a), c) in divisors.iter().zip(&of_machine).zip(&portable) {
            let exact = 317.3f32 / b;
            assert!((a - exact).abs() <= exact * f32::EPSILON && a.to_bits() == c.to_bits(), "{b}: {a} {c} {exact}");
        }
    }
}
