//! Points from depth and rays.

use super::bands::Split;
use super::simd::{Isa, LANES};

/// Where points go: x, y and z in mm of every pixel, row by row, in the camera frame; NaN where there is no depth or no ray.
#[derive(Debug)]
pub enum PointsMut<'a> {
    /// x y z x y z …: three values per pixel.
    Interleaved(&'a mut [f32]),
    /// All x, all y, all z: one value per pixel each.
    Planes([&'a mut [f32]; 3]),
}

impl PointsMut<'_> {
    /// Pixels it has place for; `None` where planes differ or a pixel has less than three values.
    pub(super) fn pixels(&self) -> Option<usize> {
        match self {
            Self::Interleaved(out) => (out.len() % 3 == 0).then_some(out.len() / 3),
            Self::Planes([x, y, z]) => (x.len() == y.len() && y.len() == z.len()).then_some(x.len()),
        }
    }

    /// The place of `count` pixels from `first` on.
    #[inline(always)]
    pub(super) fn part(&mut self, first: usize, count: usize) -> PointsMut<'_> {
        match self {
            Self::Interleaved(out) => PointsMut::Interleaved(&mut out[3 * first..3 * (first + count)]),
            Self::Planes(planes) => PointsMut::Planes(planes.each_mut().map(|p| &mut p[first..first + count])),
        }
    }
}

impl Split for PointsMut<'_> {
    fn split(self, pixels: usize) -> (Self, Self) {
        match self {
            Self::Interleaved(out) => {
                let (a, b) = out.split_at_mut(3 * pixels);
                (Self::Interleaved(a), Self::Interleaved(b))
            }
            Self::Planes([x, y, z]) => {
                let ((x0, x1), (y0, y1), (z0, z1)) =
                    (x.split_at_mut(pixels), y.split_at_mut(pixels), z.split_at_mut(pixels));
                (Self::Planes([x0, y0, z0]), Self::Planes([x1, y1, z1]))
            }
        }
    }
}

/// Depth (mm, 0 where there is none) times ray, for neighbouring pixels.
#[inline(always)]
pub(super) fn back_project<I: Isa>(isa: I, z: &[f32], rays: [&[f32]; 2], out: PointsMut<'_>) {
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
    let (blocks, rest) = out[..3 * n].as_chunks_mut::<{ 3 * LANES }>();
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
    for (((z, rx), ry), out) in z_rest.iter().zip(x_rest).zip(y_rest).zip(rest.chunks_exact_mut(3)) {
        out.copy_from_slice(&point(*z, *rx, *ry));
    }
}
