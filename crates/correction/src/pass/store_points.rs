//! Points of a chunk of corrected depth.

use crate::conventions::NO_RAY;
use crate::points::{PointsMut, back_project};
use crate::prepared::PreparedCamera;
use crate::simd::Isa;

/// Writes the points of consecutive pixels from `first` on, given their corrected depth z (mm, 0 where there is none).
#[inline(always)]
pub(crate) fn store_points<I: Isa>(isa: I, prepared: &PreparedCamera, first: usize, z: &[f32], out: PointsMut<'_>) {
    if prepared.rays_are_fixed {
        let rays = [0, 1].map(|k| &prepared.ray_planes[k][first..first + z.len()]);
        back_project(isa, z, rays, out);
    } else {
        store_on_moving_rays(prepared, first, z, out);
    }
}

/// [`store_points`] where the ray depends on depth.
#[inline(never)]
fn store_on_moving_rays(prepared: &PreparedCamera, first: usize, z: &[f32], mut out: PointsMut<'_>) {
    for (i, z) in z.iter().enumerate() {
        let depth = f64::from(*z);
        let ray = if depth > 0.0 { prepared.ray(first + i, 1.0 / depth) } else { NO_RAY };
        let point =
            if ray[0].is_nan() { [f32::NAN; 3] } else { [(ray[0] * depth) as f32, (ray[1] * depth) as f32, *z] };
        match &mut out {
            PointsMut::Interleaved(out) => out[3 * i..3 * i + 3].copy_from_slice(&point),
            PointsMut::Planes(planes) => (0..3).for_each(|k| planes[k][i] = point[k]),
        }
    }
}
