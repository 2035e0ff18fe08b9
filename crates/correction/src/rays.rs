//! True rays of all pixels: the inverse of pinhole and lens.
//!
//! The inverse of a lens has no closed form. Newton's method finds it row by row: neighbouring rows have nearly the same
//! rays, so that extrapolating the rows before leaves less than a thousandth of a pixel to one Newton step, which squares
//! that. Where the lens folds within the image, the pixels it reaches are found beforehand. This is done for the Brown–Conrady lens alone, whose derivatives are written out here; other lenses go through
//! [`Camera::ray`], pixel by pixel.

use std::ops::{Add, Div, Mul, Neg, Range, Sub};

use depthcal_model::hook::HookKind;
use depthcal_model::{Camera, Context};
use rayon::prelude::*;

use super::simd::{Isa, Kernel, dispatch};
use super::{CorrectorError, NO_RAY, pixel, probe};

/// Makes the rays of all pixels of a camera's depth image.
#[derive(Debug, Clone)]
pub struct Rays {
    camera: Camera,
    fast: Option<(Lens, Reach)>,
}

/// Rows for each thread below which it has one band only.
const LOW: usize = 400;

/// Brown–Conrady lens behind a pinhole, and where the depth image's pixels lie on the image.
#[derive(Debug, Clone, Copy)]
struct Lens {
    pinhole: [f64; 5],
    shift: [f64; 2],
    k: [f64; 5],
    limit: f64,
}

impl Rays {
    /// Prepares for a camera; where its lens breathes, for a typical depth.
    pub fn new(camera: &Camera) -> Self {
        let fast = Lens::of(camera).map(|lens| (lens, Reach::of(camera, &lens)));
        Self { camera: camera.clone(), fast }
    }

    /// x = X/Z and y = Y/Z of all pixels, row-major, in f32: within 1e-3 px. NaN where the lens maps no ray to the pixel.
    ///
    /// # Errors
    ///
    /// [`CorrectorError::Length`] where a buffer does not have one value per pixel.
    pub fn single(&self, out: [&mut [f32]; 2]) -> Result<(), CorrectorError> {
        self.fill(out)
    }

    /// The same in f64: within 1e-9 px.
    ///
    /// # Errors
    ///
    /// The same.
    pub fn double(&self, out: [&mut [f64]; 2]) -> Result<(), CorrectorError> {
        self.fill(out)
    }

    fn fill<T: Real>(&self, [x, y]: [&mut [T]; 2]) -> Result<(), CorrectorError> {
        let (width, height) = (self.camera.width, self.camera.height);
        for found in [x.len(), y.len()] {
            if found != width * height {
                return Err(CorrectorError::Length { what: "the buffer for rays", found, expected: width * height });
            }
        }
        let threads = rayon::current_num_threads();
        // Two bands for each thread, so that one that comes late finds something left; but the first rows of a band have none
        // to be extrapolated from and cost several times as much.
        let bands = if threads == 1 || height < LOW * threads { threads } else { 2 * threads };
        let band = height.div_ceil(bands).max(8);
        let work = |(k, (x, y)): (usize, (&mut [T], &mut [T]))| self.rows(k * band, x, y);
        if threads == 1 {
            work((0, (x, y)));
        } else {
            x.par_chunks_mut(band * width).zip(y.par_chunks_mut(band * width)).enumerate().for_each(work);
        }
        Ok(())
    }

    fn rows<T: Real>(&self, first: usize, x: &mut [T], y: &mut [T]) {
        let width = self.camera.width;
        match &self.fast {
            Some((lens, reach)) => dispatch(Rows { rays: self, lens, reach, first, x, y }),
            None => self.exact(first * width, x, y, |_| true),
        }
    }

    /// [`Camera::ray`] for those pixels of a row that lie beyond the lens' limit or have not settled.
    #[inline(never)]
    fn repair<T: Real>(&self, first: usize, k: &[T; 5], target: (T, T, T), limit: T, x: &mut [T], y: &mut [T]) {
        let (start, step, yd) = target;
        for u in 0..x.len() {
            let [px, py, a, _, d] = distort::<T, false>(k, x[u], y[u]);
            let (ex, ey) = (start + step * T::count(u) - px, yd - py);
            let last = T::of(T::LAST_STEP);
            // In the rows where this happens the derivatives are around a half, so that misses are like steps.
            let settled = (ex.abs() <= last) & (ey.abs() <= last) & (a > T::of(0.0)) & (d > T::of(0.0));
            if !(settled & (x[u] * x[u] + y[u] * y[u] <= limit)) {
                self.exact(first + u, &mut x[u..=u], &mut y[u..=u], |_| true);
            }
        }
    }

    /// [`Camera::ray`] for the pixels that `wanted` accepts.
    fn exact<T: Real>(&self, first: usize, x: &mut [T], y: &mut [T], wanted: impl Fn(usize) -> bool) {
        for i in (0..x.len()).filter(|i| wanted(*i)) {
            let context = Context { pixel: pixel(first + i, self.camera.width), ..Context::default() };
            let ray = self.camera.ray(self.camera.image_pixel(&context), probe::TYPICAL_RHO).unwrap_or(NO_RAY);
            [x[i], y[i]] = ray.map(T::of);
        }
    }
}

impl Lens {
    /// The lens of a camera that has that lens and no other, and whose depth image is displaced alike everywhere.
    fn of(camera: &Camera) -> Option<Self> {
        let mut pieces = camera.blocks().iter().filter(|b| b.piece().is_some() && b.hook() == HookKind::Lens);
        let k = match (pieces.next(), pieces.next()) {
            (None, _) => [0.0; 5],
            (Some(block), None) if block.name() == "brown_conrady" => block.theta.clone().try_into().ok()?,
            _ => return None,
        };
        let at = |u: usize, v: usize| {
            let pixel = [u as f64, v as f64];
            let seen = camera.image_pixel(&Context { pixel, ..Context::default() });
            [seen[0] - pixel[0], seen[1] - pixel[1]]
        };
        let shift = at(0, 0);
        let (w, h) = (camera.width, camera.height);
        let alike = |d: [f64; 2]| (d[0] - shift[0]).abs() < 1e-11 && (d[1] - shift[1]).abs() < 1e-11;
        let lens = Self { pinhole: camera.pinhole(), shift, k, limit: camera.lens_limit() };
        // A register may hold another piece of that name.
        let [x, y] = [0.21, -0.13];
        let ([u, v], [fx, fy, cx, cy, skew]) = (camera.project(&[0.21, -0.13, 1.0].into())?, lens.pinhole);
        let [a, b, ..] = distort::<f64, false>(&k, x, y);
        let same = (fx * a + skew * b + cx - u).abs() < 1e-9 && (fy * b + cy - v).abs() < 1e-9;
        (same && [at(w - 1, 0), at(w / 2, h / 2), at(w / 3, h - 1)].into_iter().all(alike)).then_some(lens)
    }
}

/// Which pixels the lens reaches. Beyond its limit it folds, and corners may see no ray.
#[derive(Debug, Clone, Default)]
struct Reach {
    /// Columns from and to, of each row; none where every pixel of the image has a ray.
    spans: Vec<[u32; 2]>,
    /// Rays of the pixels at the very limit, by their index.
    limit: Vec<(usize, [f64; 2])>,
}

impl Reach {
    fn of(camera: &Camera, lens: &Lens) -> Self {
        const AROUND: usize = 2048;
        let (width, height) = (camera.width, camera.height);
        let ring = |radius: f64| -> Vec<[f64; 2]> {
            let at = |i: usize| (std::f64::consts::TAU * i as f64 / AROUND as f64).sin_cos();
            let distorted = |(sin, cos): (f64, f64)| distort::<f64, false>(&lens.k, radius * cos, radius * sin);
            (0..AROUND).map(at).map(distorted).map(|[x, y, ..]| [x, y]).collect()
        };
        // A thousandth, which is less than a pixel, on either side of the limit.
        let (inner, outer) = (ring(lens.limit * (1.0 - 1e-3)), ring(lens.limit * (1.0 + 1e-3)));
        let [fx, fy, cx, cy, skew] = lens.pinhole;
        let y = |row: usize| (row as f64 + lens.shift[1] - cy) / fy;
        let corners = [[0, 0], [width - 1, 0], [0, height - 1], [width - 1, height - 1]];
        let farthest = corners.iter().map(|[u, v]| ((*u as f64 + lens.shift[0] - cx - skew * y(*v)) / fx).hypot(y(*v)));
        let nearest = inner.iter().map(|[x, y]| x.hypot(*y)).fold(f64::INFINITY, f64::min);
        if farthest.fold(0.0, f64::max) < nearest {
            return Self::default();
        }
        // Columns within a ring, as real numbers.
        let columns = |ring: &[[f64; 2]], y: f64| {
            let next = ring.iter().cycle().skip(1);
            let crossings = ring.iter().zip(next).filter(|(a, b)| (a[1] <= y) != (b[1] <= y));
            let at = crossings.map(|(a, b)| a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]));
            let pixel = at.map(|x| fx * x + skew * y + cx - lens.shift[0]);
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
                    let ray = camera.ray(camera.image_pixel(&context), probe::TYPICAL_RHO);
                    (row * width + u, ray.unwrap_or(NO_RAY))
                });
                ([inside.start as u32, inside.end as u32], limit.collect::<Vec<_>>())
            })
            .collect();
        let (spans, limit): (Vec<_>, Vec<_>) = rows.into_iter().unzip();
        Self { spans, limit: limit.concat() }
    }

    /// Fills in the pixels of a row that are at the limit or beyond, and tells which are not.
    #[inline(always)]
    fn fill_outside<T: Real>(&self, row: usize, x: &mut [T], y: &mut [T]) -> Range<usize> {
        let Some([from, to]) = self.spans.get(row) else { return 0..x.len() };
        let inside = *from as usize..*to as usize;
        let (first, end) = (row * x.len(), (row + 1) * x.len());
        for values in [&mut *x, &mut *y] {
            values[..inside.start].fill(T::of(f64::NAN));
            values[inside.end..].fill(T::of(f64::NAN));
        }
        let at = self.limit.partition_point(|(index, _)| *index < first);
        for (index, ray) in self.limit[at..].iter().take_while(|(index, _)| *index < end) {
            [x[index - first], y[index - first]] = ray.map(T::of);
        }
        inside
    }
}

/// A floating-point number of the row loops.
trait Real:
    Copy
    + Send
    + Sync
    + PartialOrd
    + Neg<Output = Self>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
{
    /// Rows before that are extrapolated from.
    const ROWS: usize;
    /// Longest Newton step after which none is needed, on the normalised image plane.
    const LAST_STEP: f64;
    fn of(value: f64) -> Self;
    fn abs(self) -> Self;
    fn count(value: usize) -> Self;
    /// self · b + c.
    fn fused(self, b: Self, c: Self) -> Self;
    /// self / b for b > 0.
    fn over<I: Isa>(self, isa: I, b: Self) -> Self;
}

/// a b + c, in one instruction where there is one.
#[inline(always)]
fn mul_add<T: Real, const FMA: bool>(a: T, b: T, c: T) -> T {
    if FMA { a.fused(b, c) } else { a * b + c }
}

macro_rules! real {
    ($type:ty, $rows:literal, $last:literal, $over:expr) => {
        impl Real for $type {
            const ROWS: usize = $rows;
            const LAST_STEP: f64 = $last;
            #[inline(always)]
            fn of(value: f64) -> Self {
                value as $type
            }
            #[inline(always)]
            fn abs(self) -> Self {
                self.abs()
            }
            #[inline(always)]
            fn count(value: usize) -> Self {
                value as i32 as $type
            }
            #[inline(always)]
            fn fused(self, b: Self, c: Self) -> Self {
                self.mul_add(b, c)
            }
            #[inline(always)]
            fn over<I: Isa>(self, isa: I, b: Self) -> Self {
                ($over)(isa, self, b)
            }
        }
    };
}
// A step of 1e-4 leaves some 1e-8, a hundred-thousandth of a pixel; one of 1e-7 some 1e-14.
real!(f32, 2, 1e-4, I::divide);
real!(f64, 3, 1e-7, |_, a, b| a / b);

/// x', y' of the distorted ray, and ∂x'/∂x, ∂x'/∂y = ∂y'/∂x, ∂y'/∂y.
#[inline(always)]
fn distort<T: Real, const FMA: bool>(k: &[T; 5], x: T, y: T) -> [T; 5] {
    let [k1, k2, p1, p2, k3] = *k;
    let (one, two, three) = (T::of(1.0), T::of(2.0), T::of(3.0));
    let (xx, xy) = (x * x, x * y);
    let yy = y * y;
    let r2 = xx + yy;
    let radial = mul_add::<T, FMA>(mul_add::<T, FMA>(mul_add::<T, FMA>(k3, r2, k2), r2, k1), r2, one);
    // ∂radial/∂x = 2 x · slope.
    let slope = mul_add::<T, FMA>(mul_add::<T, FMA>(three * k3, r2, two * k2), r2, k1);
    let px = mul_add::<T, FMA>(p1, x, p2 * y);
    let py = mul_add::<T, FMA>(p1, y, p2 * x);
    let xd = mul_add::<T, FMA>(x, radial, mul_add::<T, FMA>(two * p1, xy, p2 * mul_add::<T, FMA>(two, xx, r2)));
    let yd = mul_add::<T, FMA>(y, radial, mul_add::<T, FMA>(two * p2, xy, p1 * mul_add::<T, FMA>(two, yy, r2)));
    let cross = two * mul_add::<T, FMA>(xy, slope, px);
    let dxx = mul_add::<T, FMA>(two, mul_add::<T, FMA>(xx, slope, mul_add::<T, FMA>(two * p2, x, py)), radial);
    let dyy = mul_add::<T, FMA>(two, mul_add::<T, FMA>(yy, slope, mul_add::<T, FMA>(two * p1, y, py)), radial);
    [xd, yd, dxx, cross, dyy]
}

/// Some rows.
struct Rows<'a, T> {
    rays: &'a Rays,
    lens: &'a Lens,
    reach: &'a Reach,
    first: usize,
    x: &'a mut [T],
    y: &'a mut [T],
}

/// Most Newton steps for a row; what has not settled then goes through the camera.
const MOST_STEPS: usize = 8;

impl<T: Real> Kernel for Rows<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let Self { rays, lens, reach, first, x, y } = self;
        let width = rays.camera.width;
        let [fx, fy, cx, cy, skew] = lens.pinhole;
        let k = lens.k.map(T::of);
        // Rows before in which every pixel has a ray.
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
                    continue_along(own_x);
                    continue_along(own_y);
                    for (u, (x, y)) in own_x.iter_mut().zip(own_y.iter_mut()).enumerate() {
                        let known = *x <= T::of(f64::INFINITY);
                        *x = if known { *x } else { T::of(start / fx) + T::of(1.0 / fx) * T::count(u) };
                        *y = if known { *y } else { T::of(yd) };
                    }
                }
            }
            complete = if own_x.len() == width { complete + 1 } else { 0 };
            let target = (T::of(start / fx), T::of(1.0 / fx), T::of(yd));
            // Loops, not closures: only what is inlined is compiled for the machine's instruction set.
            let mut settled = false;
            for _ in 0..MOST_STEPS {
                settled = newton::<T, I>(isa, &k, target, own_x, own_y) == 0;
                if settled {
                    break;
                }
            }
            let limit = T::of(lens.limit * lens.limit);
            let mut beyond = 0;
            for (x, y) in own_x.iter().zip(own_y.iter()) {
                beyond += u32::from(!(*x * *x + *y * *y <= limit));
            }
            if !settled || beyond > 0 {
                rays.repair((first + row) * width + span.start, &k, target, limit, own_x, own_y);
                complete = 0;
            }
        }
    }
}

/// Continues one to three rows from column `from` on; one by `step`.
#[inline(always)]
fn extrapolate<T: Real>(rows: usize, before: &[T], width: usize, from: usize, own: &mut [T], step: T) {
    let n = own.len();
    let row = |k: usize| &before[before.len() - k * width + from..][..n];
    let a = row(1);
    if rows == 1 {
        for i in 0..n {
            own[i] = a[i] + step;
        }
    } else if rows == 2 {
        let b = row(2);
        for i in 0..n {
            own[i] = a[i] + (a[i] - b[i]);
        }
    } else {
        let (b, c) = (row(2), row(3));
        for i in 0..n {
            own[i] = T::of(3.0) * (a[i] - b[i]) + c[i];
        }
    }
}

/// Continues a row towards both ends where the rows before it have nothing, NaN.
#[inline(always)]
fn continue_along<T: Real>(row: &mut [T]) {
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

/// One step for all pixels of a row, whose distorted rays are (start + u · step, yd). Returns how many have not settled.
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
