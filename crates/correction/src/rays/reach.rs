//! The pixels that the lens reaches.

use std::ops::Range;

use depthcal_model::{Camera, Context};
use rayon::prelude::*;

use super::brown_conrady::{BrownConrady, distort};
use super::real::Real;
use crate::conventions::{NO_RAY, TYPICAL_RHO};

/// The pixels that the lens reaches. Beyond its limit the lens folds; pixels that only the folded part reaches have no
/// ray.
#[derive(Debug, Clone, Default)]
pub(crate) struct Reach {
    /// For each row, the columns well inside the limit: the first one, and the one after the last. Empty where every
    /// pixel has a ray.
    spans: Vec<[u32; 2]>,
    /// Index and ray of the pixels within a thousandth of the limit, in order.
    limit: Vec<(usize, [f64; 2])>,
}

impl Reach {
    /// The reach of a camera's lens.
    pub fn of(camera: &Camera, lens: &BrownConrady) -> Self {
        /// Points on a circle around the optical axis.
        const AROUND: usize = 2048;
        let (width, height) = (camera.width, camera.height);
        let ring = |radius: f64| -> Vec<[f64; 2]> {
            let direction = |i: usize| (std::f64::consts::TAU * i as f64 / AROUND as f64).sin_cos();
            let distorted = |(sin, cos): (f64, f64)| distort::<f64, false>(&lens.k, radius * cos, radius * sin);
            (0..AROUND).map(direction).map(distorted).map(|[x, y, ..]| [x, y]).collect()
        };
        // Images of circles a thousandth, which is less than a pixel, on either side of the limit.
        let (inner, outer) = (ring(lens.limit * (1.0 - 1e-3)), ring(lens.limit * (1.0 + 1e-3)));
        let [fx, fy, cx, cy, skew] = lens.pinhole;
        let y = |row: usize| (row as f64 + lens.shift[1] - cy) / fy;
        let corners = [[0, 0], [width - 1, 0], [0, height - 1], [width - 1, height - 1]];
        let farthest = corners.iter().map(|[u, v]| ((*u as f64 + lens.shift[0] - cx - skew * y(*v)) / fx).hypot(y(*v)));
        let nearest = inner.iter().map(|[x, y]| x.hypot(*y)).fold(f64::INFINITY, f64::min);
        if farthest.fold(0.0, f64::max) < nearest {
            return Self::default();
        }
        // First and last column within a ring in the row at y, as real numbers.
        let columns = |ring: &[[f64; 2]], y: f64| {
            let next = ring.iter().cycle().skip(1);
            let crossings = ring.iter().zip(next).filter(|(a, b)| (a[1] <= y) != (b[1] <= y));
            let x_at_crossing = crossings.map(|(a, b)| a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]));
            let pixel = x_at_crossing.map(|x| fx * x + skew * y + cx - lens.shift[0]);
            pixel.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], u| [low.min(u), high.max(u)])
        };
        let whole = |[low, high]: [f64; 2]| {
            let [from, to] = [low.ceil(), high.floor() + 1.0].map(|u| u.clamp(0.0, width as f64) as usize);
            if low <= high { from..to.max(from) } else { 0..0 }
        };
        let rows: Vec<_> = (0..height)
            .into_par_iter()
            .map(|row| {
                let (inside, all) = (whole(columns(&inner, y(row))), whole(columns(&outer, y(row))));
                let limit = all.filter(|u| !inside.contains(u)).map(|u| {
                    let context = Context { pixel: [u as f64, row as f64], ..Context::default() };
                    let ray = camera.ray(camera.image_pixel(&context), TYPICAL_RHO);
                    (row * width + u, ray.unwrap_or(NO_RAY))
                });
                ([inside.start as u32, inside.end as u32], limit.collect::<Vec<_>>())
            })
            .collect();
        let (spans, limit): (Vec<_>, Vec<_>) = rows.into_iter().unzip();
        Self { spans, limit: limit.concat() }
    }

    /// Writes the rays of those pixels of a row that are near the limit or beyond. Returns the columns of the others.
    #[inline(always)]
    pub fn fill_outside<T: Real>(&self, row: usize, x: &mut [T], y: &mut [T]) -> Range<usize> {
        let Some([from, to]) = self.spans.get(row) else { return 0..x.len() };
        let inside = *from as usize..*to as usize;
        let (first, end) = (row * x.len(), (row + 1) * x.len());
        for values in [&mut *x, &mut *y] {
            values[..inside.start].fill(T::of(f64::NAN));
            values[inside.end..].fill(T::of(f64::NAN));
        }
        let start = self.limit.partition_point(|(index, _)| *index < first);
        for (index, ray) in self.limit[start..].iter().take_while(|(index, _)| *index < end) {
            [x[index - first], y[index - first]] = ray.map(T::of);
        }
        inside
    }
}
