//! Points from depth in f32.

use super::buffer::PointsMut;
use crate::simd::{Isa, LANES};

/// Points of consecutive pixels: depth z (mm, 0 where there is none) times ray (x, y, 1).
#[inline(always)]
pub(crate) fn back_project<I: Isa>(isa: I, z: &[f32], rays: [&[f32]; 2], out: PointsMut<'_>) {
    match out {
        PointsMut::Interleaved(out) => interleaved(isa, z, rays, out),
        PointsMut::Planes(planes) => {
            let n = z.len();
            let [rx, ry] = rays.map(|r| &r[..n]);
            let [x, y, depth] = planes.map(|plane| &mut plane[..n]);
            for i in 0..n {
                [x[i], y[i], depth[i]] = point(z[i], rx[i], ry[i]);
            }
        }
    }
}

#[inline(always)]
fn point(z: f32, rx: f32, ry: f32) -> [f32; 3] {
    let depth = if (z > 0.0) & !rx.is_nan() { z } else { f32::NAN };
    [rx * depth, ry * depth, depth]
}

#[inline(always)]
fn interleaved<I: Isa>(isa: I, z: &[f32], rays: [&[f32]; 2], out: &mut [f32]) {
    let n = z.len();
    let [rx, ry] = rays.map(|r| &r[..n]);
    let (blocks, out_rest) = out[..3 * n].as_chunks_mut::<{ 3 * LANES }>();
    let (z_blocks, z_rest) = z.as_chunks::<LANES>();
    let (x_blocks, x_rest) = rx.as_chunks::<LANES>();
    let (y_blocks, y_rest) = ry.as_chunks::<LANES>();
    for (((z, rx), ry), out) in z_blocks.iter().zip(x_blocks).zip(y_blocks).zip(blocks) {
        let (mut x, mut y, mut depth) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        for i in 0..LANES {
            depth[i] = if (z[i] > 0.0) & !rx[i].is_nan() { z[i] } else { f32::NAN };
        }
        for i in 0..LANES {
            x[i] = rx[i] * depth[i];
        }
        for i in 0..LANES {
            y[i] = ry[i] * depth[i];
        }
        isa.interleave(&x, &y, &depth, out);
    }
    for (((z, rx), ry), out) in z_rest.iter().zip(x_rest).zip(y_rest).zip(out_rest.chunks_exact_mut(3)) {
        out.copy_from_slice(&point(*z, *rx, *ry));
    }
}
