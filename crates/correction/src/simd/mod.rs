//! Loops compiled for several instruction sets, the best of which is chosen at run time.
//!
//! A [`Kernel`] is a plain loop over slices. [`dispatch`] compiles it once for each instruction set that pulp knows
//! (AVX-512, AVX2 with FMA, NEON, the baseline of the target) and runs the version for the present machine;
//! vectorisation is left to the compiler. Operations that it vectorises badly are methods of [`Isa`]. A kernel that is
//! faster in AVX-512's own instructions has a second version for them ([`Specialised`]).

mod aligned;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod count;
mod dispatch;
mod isa;

pub(crate) use aligned::Aligned;
#[cfg(target_arch = "x86_64")]
pub(crate) use aligned::LINE;
pub(crate) use count::{count_f32, count_u16, measurement};
pub(crate) use dispatch::{Kernel, dispatch};
#[cfg(test)]
pub(crate) use isa::Portable;
pub(crate) use isa::{Isa, LANES, Specialised};
