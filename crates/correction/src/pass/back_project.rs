//! Points of depth that is corrected already.

use super::buffers::Input;
use super::formats::load;
use super::store_points::store_points;
use crate::bands::{CHUNK, STRETCH, for_bands};
use crate::points::{DepthOnRays, PointsMut, from_u16};
use crate::prepared::PreparedCamera;
use crate::simd::{Isa, Kernel, dispatch};
use crate::summary::CorrectionSummary;

/// Back-projects corrected depth, with steps of `unit_mm` where it is in steps. Sizes must have been checked.
pub(crate) fn back_project(prepared: &PreparedCamera, input: Input<'_>, unit_mm: f64, out: PointsMut<'_>) {
    for_bands(prepared.pixels(), out, &|first, count, out| {
        dispatch(BackProject { prepared, input, unit_mm: unit_mm as f32, out, first, count });
        CorrectionSummary::default()
    });
}

/// A band of consecutive pixels to be back-projected.
struct BackProject<'a> {
    prepared: &'a PreparedCamera,
    input: Input<'a>,
    unit_mm: f32,
    out: PointsMut<'a>,
    first: usize,
    count: usize,
}

impl Kernel for BackProject<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(mut self, isa: I) {
        if let (Input::U16(depth), PointsMut::Interleaved(out), true) =
            (self.input, &mut self.out, self.prepared.rays_are_fixed)
        {
            for (k, out) in out[..3 * self.count].chunks_mut(3 * STRETCH).enumerate() {
                let (first, count) = (self.first + k * STRETCH, out.len() / 3);
                let (pixels, unit_mm) = (first..first + count, self.unit_mm);
                let rays = [0, 1].map(|k| &self.prepared.ray_planes[k][pixels.clone()]);
                let (map, cubics) = ((0.0, [0.0; 3]), self.prepared.ray_cubics.part(first, count));
                from_u16::<I, false>(isa, DepthOnRays { map, measured: &depth[pixels], unit_mm, rays, cubics, out });
            }
            return;
        }
        for offset in (0..self.count).step_by(CHUNK) {
            let count = CHUNK.min(self.count - offset);
            let first = self.first + offset;
            let mut z = [0.0f32; CHUNK];
            let z = &mut z[..count];
            match self.input {
                Input::U16(depth) => load(&depth[first..first + count], self.unit_mm, z),
                Input::F32(depth) => load(&depth[first..first + count], self.unit_mm, z),
                Input::Output => {}
            }
            store_points(isa, self.prepared, first, z, self.out.part(offset, count));
        }
    }
}
