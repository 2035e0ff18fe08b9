//! True rays of all pixels: the inverse of pinhole and lens.
//!
//! The inverse of a lens has no closed form. For the Brown–Conrady lens, whose derivatives are written out in
//! `brown_conrady`, it is found row by row by Newton's method (`rows`); where that lens folds within the image, the
//! pixels that it reaches are determined beforehand (`reach`). For other lenses every pixel goes through
//! [`depthcal_model::Camera::ray`] (`exact`).

mod all_pixels;
mod brown_conrady;
mod cubics;
mod exact;
mod reach;
mod real;
mod rows;

pub use all_pixels::Rays;

#[cfg(target_arch = "x86_64")]
pub(crate) use cubics::PLACES;
pub(crate) use cubics::{Cubic, RayCubics};
