//! The fast path: depth pieces that are affine in inverse depth at every pixel.

use depthcal_model::hook::HookKind;
use depthcal_model::{Camera, Context};
use rayon::prelude::*;

use super::{pixel, probe};

/// Pieces whose measured inverse depth is a + b ρ with a and b that depend on the pixel alone.
const AFFINE: &[&str] = &["projective", "free_map", "bspline"];

/// ρ_m = a + b ρ at every pixel, that is z = b z_m / (1 − a z_m).
#[derive(Debug, Clone)]
pub(super) struct Affine {
    /// a (1/mm) and b of every pixel; NaN where there is no ray.
    pixels: Vec<[f64; 2]>,
}

impl Affine {
    /// The table of a camera whose depth pieces are all of that kind.
    pub fn new(camera: &Camera, rays: &[[f64; 2]]) -> Option<Self> {
        let depth = || camera.blocks().iter().filter(|b| b.hook() == HookKind::Depth);
        if !depth().all(|b| AFFINE.contains(&b.name())) {
            return None;
        }
        let entry = |(index, ray): (usize, &[f64; 2])| {
            if ray[0].is_nan() {
                return Some([f64::NAN; 2]);
            }
            let context = Context { pixel: pixel(index, camera.width), ..Context::default() };
            let measured = |rho: f64| camera.measured_inverse_depth(&context, *ray, 1.0, rho);
            let a = measured(0.0);
            let b = measured(1.0) - a;
            // A register may hold another piece of the same name.
            let expected = a + b * probe::TYPICAL_RHO;
            let affine = (measured(probe::TYPICAL_RHO) - expected).abs() <= 1e-12 * expected.abs();
            affine.then_some([a, b])
        };
        let pixels = rays.par_iter().enumerate().map(entry).collect::<Option<_>>()?;
        Some(Self { pixels })
    }

    /// True depth (mm) of a measured one.
    #[inline(always)]
    pub fn correct(&self, index: usize, measured_mm: f64) -> Option<f64> {
        let [a, b] = self.pixels[index];
        let left = 1.0 - a * measured_mm;
        let depth_mm = b * measured_mm / left;
        (left > 0.0 && b > 0.0 && depth_mm.is_finite()).then_some(depth_mm)
    }
}
