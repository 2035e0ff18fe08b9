//! Points: depth times ray.

#[cfg(target_arch = "x86_64")]
mod avx512;
mod back_project;
mod buffer;
mod from_u16;
mod portable;

pub use buffer::PointsMut;

pub(crate) use back_project::back_project;
pub(crate) use from_u16::from_u16;
pub(crate) use portable::DepthOnRays;
