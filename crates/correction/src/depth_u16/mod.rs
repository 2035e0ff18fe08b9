//! 16-bit depth corrected to 16-bit depth by a single Möbius map, in one pass: the path of most cameras.
//!
//! Depths of 0 and 65535 are no measurements and become 0. Measured depth is a whole number of steps; the change of
//! depth is computed and rounded, not the corrected depth, so that the roundings of f32 are small against a step. The
//! largest depth of a chunk gives a bound on the error of f32 before rounding. Where that bound is above
//! [`MOST_ERROR`], the chunk is corrected in f64, so that every result lies within half a step and [`MOST_ERROR`] of
//! the exact inverse.

#[cfg(target_arch = "x86_64")]
mod avx512;
mod bounds;
mod chunk;
mod correct;

pub(crate) use bounds::{Bounds, MOST_ERROR};
pub(crate) use chunk::Chunk;
pub(crate) use correct::correct;
