//! Points from 16-bit depth, as plain loops.

use crate::plan::true_depth;
use crate::rays::Cubic;
use crate::simd::{Isa, LANES, measurement};

/// 16-bit depth and rays of consecutive pixels, and the place of their points, x y z x y z …
pub(crate) struct DepthOnRays<'a> {
    /// The Möbius map that corrects the depth: p, and (dx, dy, dz) of r = dx x + dy y + dz over the rays
    /// (`plan::moebius`).
    pub map: (f32, [f32; 3]),
    /// Depth in steps of `unit_mm`; 0 or 65535 where there is none.
    pub measured: &'a [u16],
    pub unit_mm: f32,
    /// x and y of the rays; NaN where there is none.
    pub rays: [&'a [f32]; 2],
    /// The rays as cubics over sixteen pixels each.
    pub cubics: &'a [[Cubic; 2]],
    pub out: &'a mut [f32],
}

/// The number of pixels with a depth, and of those with a depth and a ray, which have a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct PointCounts {
    pub depths: usize,
    pub points: usize,
}

/// Computes points from 16-bit depth, which is corrected first if CORRECT. `None`, with unspecified `out`, where f32 is
/// not precise enough for a pixel.
#[inline(always)]
pub(crate) fn from_u16<I: Isa, const CORRECT: bool>(isa: I, from: DepthOnRays<'_>) -> Option<PointCounts> {
    let DepthOnRays { map, measured, unit_mm, rays, out, .. } = from;
    let (measured_blocks, measured_rest) = measured.as_chunks::<LANES>();
    let (x_blocks, x_rest) = rays[0].as_chunks::<LANES>();
    let (y_blocks, y_rest) = rays[1].as_chunks::<LANES>();
    let (blocks, last_points) = out.as_chunks_mut::<{ 3 * LANES }>();
    let [mut points, mut lost] = [[0u32; LANES]; 2];
    for (((measured, x), y), out) in measured_blocks.iter().zip(x_blocks).zip(y_blocks).zip(blocks) {
        let counts = block::<I, CORRECT>(isa, map, (measured, unit_mm), [x, y], out);
        for i in 0..LANES {
            points[i] += counts[0][i];
        }
        for i in 0..LANES {
            lost[i] |= counts[1][i];
        }
    }
    if !measured_rest.is_empty() {
        let n = measured_rest.len();
        let (mut last, mut x, mut y, mut out) = ([0; LANES], [0.0; LANES], [0.0; LANES], [0.0; 3 * LANES]);
        last[..n].copy_from_slice(measured_rest);
        x[..n].copy_from_slice(x_rest);
        y[..n].copy_from_slice(y_rest);
        let counts = block::<I, CORRECT>(isa, map, (&last, unit_mm), [&x, &y], &mut out);
        last_points.copy_from_slice(&out[..3 * n]);
        points[0] += counts[0].iter().sum::<u32>();
        lost[0] |= counts[1].iter().fold(0, |any, lost| any | lost);
    }
    let (depths, points) = (isa.max_and_count(measured).1, points.iter().sum::<u32>() as usize);
    lost.iter().all(|lost| *lost == 0).then_some(PointCounts { depths, points })
}

/// [`from_u16`] for one block. Returns, per pixel, 1 or 0 for whether it has a point, and for whether f32 is not
/// precise enough for it.
#[inline(always)]
fn block<I: Isa, const CORRECT: bool>(
    isa: I,
    (p, [dx, dy, dz]): (f32, [f32; 3]),
    (measured, unit_mm): (&[u16; LANES], f32),
    [rx, ry]: [&[f32; LANES]; 2],
    out: &mut [f32; 3 * LANES],
) -> [[u32; LANES]; 2] {
    let (mut x, mut y, mut depth) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
    let [mut has_point, mut lost] = [[0; LANES]; 2];
    for i in 0..LANES {
        let z = f32::from(measurement(measured[i])) * unit_mm;
        let (corrected, usable) = if CORRECT {
            let r = isa.mul_add(dx, rx[i], isa.mul_add(dy, ry[i], dz));
            true_depth::<I, false, true>(isa, (p, 0.0, r), z)
        } else {
            (z, true)
        };
        let valid = (z > 0.0) & !rx[i].is_nan();
        depth[i] = if valid { corrected } else { f32::NAN };
        has_point[i] = u32::from(valid);
        lost[i] = u32::from(valid & !usable);
    }
    for i in 0..LANES {
        x[i] = rx[i] * depth[i];
    }
    for i in 0..LANES {
        y[i] = ry[i] * depth[i];
    }
    isa.interleave(&x, &y, &depth, out);
    [has_point, lost]
}
