//! Points from depth and rays.

#[cfg(target_arch = "x86_64")]
pub(super) mod avx512;

use super::bands::Split;
use super::cubics::Cubic;
use super::moebius::true_depth;
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

/// Neighbouring pixels of 16 bits whose points are wanted, x y z x y z …
pub(super) struct FromSteps<'a> {
    /// p of the Möbius map that corrects them (see `moebius`), and r over the rays.
    pub map: (f32, [f32; 3]),
    pub measured: &'a [u16],
    pub unit_mm: f32,
    pub rays: [&'a [f32]; 2],
    /// The same, sixteen pixels each.
    pub cubics: &'a [[Cubic; 2]],
    pub out: &'a mut [f32],
}

/// How many pixels have depth, and how many of them a ray too.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Found {
    pub depths: usize,
    pub points: usize,
}

/// Points while depth is in registers, corrected or as it is. `None`, with `out` undefined, where f32 does not do for some.
#[inline(always)]
pub(super) fn from_steps<I: Isa, const CORRECT: bool>(isa: I, from: FromSteps<'_>) -> Option<Found> {
    let FromSteps { map, measured, unit_mm, rays, out, .. } = from;
    let (measured_blocks, measured_rest) = measured.as_chunks::<LANES>();
    let (x_blocks, x_rest) = rays[0].as_chunks::<LANES>();
    let (y_blocks, y_rest) = rays[1].as_chunks::<LANES>();
    let (blocks, rest) = out.as_chunks_mut::<{ 3 * LANES }>();
    let [mut points, mut lost] = [[0u32; LANES]; 2];
    for (((measured, x), y), out) in measured_blocks.iter().zip(x_blocks).zip(y_blocks).zip(blocks) {
        let found = block::<I, CORRECT>(isa, map, (measured, unit_mm), [x, y], out);
        for i in 0..LANES {
            points[i] += found[0][i];
        }
        for i in 0..LANES {
            lost[i] |= found[1][i];
        }
    }
    if !measured_rest.is_empty() {
        let n = measured_rest.len();
        let (mut last, mut x, mut y, mut out) = ([0; LANES], [0.0; LANES], [0.0; LANES], [0.0; 3 * LANES]);
        last[..n].copy_from_slice(measured_rest);
        x[..n].copy_from_slice(x_rest);
        y[..n].copy_from_slice(y_rest);
        let found = block::<I, CORRECT>(isa, map, (&last, unit_mm), [&x, &y], &mut out);
        rest.copy_from_slice(&out[..3 * n]);
        points[0] += found[0].iter().sum::<u32>();
        lost[0] |= found[1].iter().fold(0, |any, lost| any | lost);
    }
    let (depths, points) = (isa.most_and_count(measured).1, points.iter().sum::<u32>() as usize);
    lost.iter().all(|lost| *lost == 0).then_some(Found { depths, points })
}

/// [`from_steps`] for some pixels: 1 where there is a point, and where it is lost.
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
        let z = f32::from(measured[i]) * unit_mm;
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
