//! Choice of the instruction set at run time.

use pulp::{Arch, Simd, WithSimd};

use super::isa::{Isa, Portable};

/// A loop to be compiled for every instruction set.
pub(crate) trait Kernel {
    type Output;

    /// Runs the loop. This must be `#[inline(always)]`, and so must everything that is called in its inner loops: a
    /// function or closure that is not inlined is compiled for the target's baseline, not for the instruction set.
    fn run<I: Isa>(self, isa: I) -> Self::Output;
}

/// Runs the version of a kernel that is compiled for the present machine.
pub(crate) fn dispatch<K: Kernel>(kernel: K) -> K::Output {
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
    use crate::simd::LANES;

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
