//! Rays by the camera's own inverse, pixel by pixel.

use depthcal_model::{Camera, Context};

use super::brown_conrady::distort;
use super::real::Real;
use crate::conventions::{NO_RAY, TYPICAL_RHO, pixel};

/// Replaces the rays of those pixels of a row for which Newton's method has not converged or went beyond the lens'
/// limit by [`Camera::ray`]. `first` is the index of the row's first pixel, `target` as in `newton`.
#[inline(never)]
pub(crate) fn repair<T: Real>(
    camera: &Camera,
    first: usize,
    k: &[T; 5],
    target: (T, T, T),
    limit: T,
    x: &mut [T],
    y: &mut [T],
) {
    let (start, step, yd) = target;
    for u in 0..x.len() {
        let [px, py, a, _, d] = distort::<T, false>(k, x[u], y[u]);
        let (ex, ey) = (start + step * T::count(u) - px, yd - py);
        let last = T::of(T::LAST_STEP);
        // In such rows the derivatives are around a half, so that a miss is about as long as the Newton step.
        let converged = (ex.abs() <= last) & (ey.abs() <= last) & (a > T::of(0.0)) & (d > T::of(0.0));
        if !(converged & (x[u] * x[u] + y[u] * y[u] <= limit)) {
            exact(camera, first + u, &mut x[u..=u], &mut y[u..=u]);
        }
    }
}

/// [`Camera::ray`] for consecutive pixels, the first of which has the index `first`; NaN where there is none.
pub(crate) fn exact<T: Real>(camera: &Camera, first: usize, x: &mut [T], y: &mut [T]) {
    for i in 0..x.len() {
        let context = Context { pixel: pixel(first + i, camera.width), ..Context::default() };
        let ray = camera.ray(camera.image_pixel(&context), TYPICAL_RHO).unwrap_or(NO_RAY);
        [x[i], y[i]] = ray.map(T::of);
    }
}
