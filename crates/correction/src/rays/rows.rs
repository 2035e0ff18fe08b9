//! Rays of whole rows by Newton's method.
//!
//! Neighbouring rows have nearly the same rays. Extrapolating a row from those before it starts Newton's method less
//! than a thousandth of a pixel from the root, and one step squares that error.

use depthcal_model::Camera;

use super::brown_conrady::{BrownConrady, distort};
use super::exact::repair;
use super::reach::Reach;
use super::real::Real;
use crate::simd::{Isa, Kernel};

/// Rays of consecutive rows.
pub(crate) struct Rows<'a, T> {
    pub camera: &'a Camera,
    pub lens: &'a BrownConrady,
    pub reach: &'a Reach,
    /// The first row.
    pub first: usize,
    /// x and y of the rays, row-major.
    pub x: &'a mut [T],
    pub y: &'a mut [T],
}

/// Most Newton steps for a row. Pixels that have not converged then are left to the camera's own inverse.
const MOST_STEPS: usize = 8;

impl<T: Real> Kernel for Rows<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let Self { camera, lens, reach, first, x, y } = self;
        let width = camera.width;
        let [fx, fy, cx, cy, skew] = lens.pinhole;
        let k = lens.k.map(T::of);
        // Number of rows directly before this one in which every pixel has a ray.
        let mut complete = 0;
        for row in 0..x.len() / width {
            let yd = ((first + row) as f64 + lens.shift[1] - cy) / fy;
            let (before_x, own_x) = x.split_at_mut(row * width);
            let (before_y, own_y) = y.split_at_mut(row * width);
            let span = reach.fill_outside(first + row, &mut own_x[..width], &mut own_y[..width]);
            let (own_x, own_y) = (&mut own_x[span.clone()], &mut own_y[span.clone()]);
            let start = span.start as f64 + lens.shift[0] - cx - skew * yd;
            if row == 0 {
                for (u, (x, y)) in own_x.iter_mut().zip(own_y.iter_mut()).enumerate() {
                    (*x, *y) = (T::of((u as f64 + start) / fx), T::of(yd));
                }
            } else {
                let rows = row.min(T::ROWS);
                extrapolate(rows, before_x, width, span.start, own_x, T::of(0.0));
                extrapolate(rows, before_y, width, span.start, own_y, T::of(1.0 / fy));
                if complete < rows {
                    fill_ends(own_x);
                    fill_ends(own_y);
                    for (u, (x, y)) in own_x.iter_mut().zip(own_y.iter_mut()).enumerate() {
                        let known = *x <= T::of(f64::INFINITY);
                        *x = if known { *x } else { T::of(start / fx) + T::of(1.0 / fx) * T::count(u) };
                        *y = if known { *y } else { T::of(yd) };
                    }
                }
            }
            complete = if own_x.len() == width { complete + 1 } else { 0 };
            let target = (T::of(start / fx), T::of(1.0 / fx), T::of(yd));
            // Loops, not closures: a closure that is not inlined is compiled for the target's baseline.
            let mut converged = false;
            for _ in 0..MOST_STEPS {
                converged = newton::<T, I>(isa, &k, target, own_x, own_y) == 0;
                if converged {
                    break;
                }
            }
            let limit = T::of(lens.limit * lens.limit);
            let mut beyond = 0;
            for (x, y) in own_x.iter().zip(own_y.iter()) {
                beyond += u32::from(!(*x * *x + *y * *y <= limit));
            }
            if !converged || beyond > 0 {
                repair(camera, (first + row) * width + span.start, &k, target, limit, own_x, own_y);
                complete = 0;
            }
        }
    }
}

/// Extrapolates a row from the one to three rows before it, from column `from` on. A single row is continued by adding
/// `step`.
#[inline(always)]
fn extrapolate<T: Real>(rows: usize, before: &[T], width: usize, from: usize, row: &mut [T], step: T) {
    let n = row.len();
    let previous = |k: usize| &before[before.len() - k * width + from..][..n];
    let a = previous(1);
    if rows == 1 {
        for i in 0..n {
            row[i] = a[i] + step;
        }
    } else if rows == 2 {
        let b = previous(2);
        for i in 0..n {
            row[i] = a[i] + (a[i] - b[i]);
        }
    } else {
        let (b, c) = (previous(2), previous(3));
        for i in 0..n {
            row[i] = T::of(3.0) * (a[i] - b[i]) + c[i];
        }
    }
}

/// Extrapolates a row along itself towards both ends, where the rows before it have no ray (NaN).
#[inline(always)]
fn fill_ends<T: Real>(row: &mut [T]) {
    let known = |value: &T| *value <= T::of(f64::INFINITY);
    let (Some(from), Some(last)) = (row.iter().position(known), row.iter().rposition(known)) else { return };
    if from < last {
        for u in (0..from).rev() {
            row[u] = row[u + 1] + (row[u + 1] - row[u + 2]);
        }
        for u in last + 1..row.len() {
            row[u] = row[u - 1] + (row[u - 1] - row[u - 2]);
        }
    }
}

/// A Newton step for all pixels of a row, whose distorted rays are (start + u · step, yd). Returns the number of pixels
/// that have not converged.
#[inline(always)]
fn newton<T: Real, I: Isa>(isa: I, k: &[T; 5], (start, step, yd): (T, T, T), x: &mut [T], y: &mut [T]) -> u32 {
    let width = x.len();
    let y = &mut y[..width];
    let mut moving = 0;
    let last = T::of(T::LAST_STEP);
    for u in 0..width {
        let [px, py, a, b, d] =
            if I::FMA { distort::<T, true>(k, x[u], y[u]) } else { distort::<T, false>(k, x[u], y[u]) };
        let (ex, ey) = (start + step * T::count(u) - px, yd - py);
        let det = a * d - b * b;
        let scale = T::of(1.0).over(isa, det);
        let (dx, dy) = ((d * ex - b * ey) * scale, (a * ey - b * ex) * scale);
        x[u] = x[u] + dx;
        y[u] = y[u] + dy;
        moving += u32::from(!((dx.abs() <= last) & (dy.abs() <= last) & (det > T::of(0.0))));
    }
    moving
}
