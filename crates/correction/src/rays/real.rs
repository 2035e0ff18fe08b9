//! The floating-point types that rays are computed in.

use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::simd::Isa;

/// f32 or f64.
pub(crate) trait Real:
    Copy
    + Send
    + Sync
    + PartialOrd
    + Neg<Output = Self>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
{
    /// Most rows that the next one is extrapolated from.
    const ROWS: usize;
    /// Longest Newton step, on the normalised image plane, after which no other is needed.
    const LAST_STEP: f64;
    /// The value rounded to this type.
    fn of(value: f64) -> Self;
    fn abs(self) -> Self;
    /// A column number in this type.
    fn count(value: usize) -> Self;
    /// self · b + c, rounded once.
    fn fused(self, b: Self, c: Self) -> Self;
    /// self / b for b > 0, to within an ulp.
    fn over<I: Isa>(self, isa: I, b: Self) -> Self;
}

/// a b + c, in one instruction where the instruction set has it.
#[inline(always)]
pub(crate) fn mul_add<T: Real, const FMA: bool>(a: T, b: T, c: T) -> T {
    if FMA { a.fused(b, c) } else { a * b + c }
}

macro_rules! real {
    ($type:ty, $rows:literal, $last:literal, $over:expr) => {
        impl Real for $type {
            const ROWS: usize = $rows;
            const LAST_STEP: f64 = $last;
            #[inline(always)]
            fn of(value: f64) -> Self {
                value as $type
            }
            #[inline(always)]
            fn abs(self) -> Self {
                self.abs()
            }
            #[inline(always)]
            fn count(value: usize) -> Self {
                value as i32 as $type
            }
            #[inline(always)]
            fn fused(self, b: Self, c: Self) -> Self {
                self.mul_add(b, c)
            }
            #[inline(always)]
            fn over<I: Isa>(self, isa: I, b: Self) -> Self {
                ($over)(isa, self, b)
            }
        }
    };
}
// Newton's method squares its error: a last step of 1e-4 leaves some 1e-8, a hundred-thousandth of a pixel; one of 1e-7
// some 1e-14.
real!(f32, 2, 1e-4, I::divide);
real!(f64, 3, 1e-7, |_, a, b| a / b);
