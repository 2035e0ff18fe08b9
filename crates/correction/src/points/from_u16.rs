//! Points from 16-bit depth, by the version of the loop that is fastest on the present instruction set.

#[cfg(target_arch = "x86_64")]
use pulp::x86::V4;

#[cfg(target_arch = "x86_64")]
use super::avx512;
use super::portable::{self, DepthOnRays, PointCounts};
use crate::simd::{Isa, Specialised};

struct FromU16<'a, const CORRECT: bool>(DepthOnRays<'a>);

impl<const CORRECT: bool> Specialised for FromU16<'_, CORRECT> {
    type Output = Option<PointCounts>;

    #[inline(always)]
    fn portable<I: Isa>(self, isa: I) -> Option<PointCounts> {
        portable::from_u16::<I, CORRECT>(isa, self.0)
    }

    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    fn avx512(self, v4: V4) -> Option<PointCounts> {
        avx512::from_u16::<CORRECT>(v4, self.0)
    }
}

/// Computes points from 16-bit depth, which is corrected first if CORRECT. `None`, with unspecified output, where f32
/// is not precise enough for a pixel.
#[inline(always)]
pub(crate) fn from_u16<I: Isa, const CORRECT: bool>(isa: I, pixels: DepthOnRays<'_>) -> Option<PointCounts> {
    isa.specialised(FromU16::<CORRECT>(pixels))
}
