//! The inverse of a camera for batches of pixels: rays of grids of pixels, and true from measured inverse depths.
//!
//! The results are those of [`Camera::ray`] and [`Camera::true_inverse_depth`] up to rounding; a batch costs one virtual call per
//! piece and Newton step instead of one per pixel.

use crate::camera::Camera;
use crate::hook::HookKind;
use crate::piece::Context;

/// Newton steps of a batch; pixels that need more are solved one by one.
const MOST_STEPS: usize = 8;
/// Step on the normalised image plane below which the next one is below rounding: Newton's method squares it.
const RAY_SETTLED: f64 = 1e-8;
/// Relative residual at which an inverse depth is accepted, see [`Camera::true_inverse_depth`].
const DEPTH_SETTLED: f64 = 1e-13;
/// Relative step of an inverse depth from which on slopes are taken from differences.
const SECANT: f64 = 1e-8;

impl Camera {
    /// Whether a pixel has the same ray at all depths: only a lens that breathes has not.
    pub fn has_fixed_rays(&self) -> bool {
        const RADII: usize = 6;
        const DIRECTIONS: usize = 7;
        let limit = self.lens_limit();
        let states: Vec<f64> = (0..RADII * DIRECTIONS * 3)
            .flat_map(|i| {
                let (r, direction, depth) = (i % RADII, i / RADII % DIRECTIONS, i / (RADII * DIRECTIONS));
                let radius = limit * (r + 1) as f64 / RADII as f64;
                let (s, c) = (std::f64::consts::TAU * direction as f64 / DIRECTIONS as f64 + 0.3).sin_cos();
                [radius * c, radius * s, [3e-4, 1e-3, 4e-3][depth], radius * c, radius * s]
            })
            .collect();
        let n = states.len() / 5;
        let contexts = vec![Context::default(); n];
        let (mut out, mut d) = (vec![0.0; 2 * n], vec![0.0; 10 * n]);
        self.of(HookKind::Lens).all(|(piece, theta)| {
            piece.linearize(theta, &states, &contexts, &mut out, &mut d, None);
            d.chunks_exact(5).all(|row| row[2] == 0.0)
        })
    }

    /// Rays (X/Z, Y/Z) of the pixels `grid` of the image, row by row. NaN where the lens model has no inverse. Only for cameras
    /// with [fixed rays](Camera::has_fixed_rays); pixel pieces do not take part.
    pub fn rays_of_grid(&self, grid: &PixelGrid) -> Vec<[f64; 2]> {
        let n = grid.columns;
        let mut rays: Vec<[f64; 2]> = Vec::with_capacity(n * grid.rows);
        let mut scratch = RowScratch::default();
        for row in 0..grid.rows {
            if row == 0 {
                rays.extend((0..n).map(|column| self.ray_or_nan(grid.pixel(column, row))));
                continue;
            }
            // The rows above predict this one.
            for column in 0..n {
                let [a, b] = [1, 2].map(|back| rays[(row.max(back) - back) * n + column]);
                rays.push([2.0 * a[0] - b[0], 2.0 * a[1] - b[1]]);
            }
            self.refine_row(grid, row, &mut rays[row * n..], &mut scratch);
        }
        rays
    }

    fn ray_or_nan(&self, pixel: [f64; 2]) -> [f64; 2] {
        self.ray(pixel, 1e-3).unwrap_or([f64::NAN; 2])
    }

    /// Newton's method on all pixels of a row together, from rays that are nearly right.
    fn refine_row(&self, grid: &PixelGrid, row: usize, rays: &mut [[f64; 2]], scratch: &mut RowScratch) {
        let n = rays.len();
        let [fx, fy, cx, cy, skew] = self.pinhole();
        scratch.contexts.resize(n, Context::default());
        scratch.step.clear();
        scratch.step.resize(n, f64::INFINITY);
        for _ in 0..MOST_STEPS {
            self.distort_batch(rays, scratch);
            let mut worst = 0.0_f64;
            for (column, ray) in rays.iter_mut().enumerate() {
                let [u, v] = grid.pixel(column, row);
                let yd = (v - cy) / fy;
                let xd = (u - cx - skew * yd) / fx;
                let d = &scratch.total[4 * column..4 * column + 4];
                let (ex, ey) = (xd - scratch.state[5 * column + 3], yd - scratch.state[5 * column + 4]);
                let det = d[0] * d[3] - d[1] * d[2];
                let step = [(d[3] * ex - d[1] * ey) / det, (d[0] * ey - d[2] * ex) / det];
                let size = if det > 0.0 { step[0].abs().max(step[1].abs()) } else { f64::NAN };
                *ray = [ray[0] + step[0], ray[1] + step[1]];
                scratch.step[column] = size;
                // NaN does not raise the maximum: such pixels are left to the method for single ones.
                worst = worst.max(size);
            }
            if worst < RAY_SETTLED {
                break;
            }
        }
        let limit = self.lens_limit();
        for (column, ray) in rays.iter_mut().enumerate() {
            // Negated so that NaN is refused too.
            if !(scratch.step[column] < RAY_SETTLED && ray[0].hypot(ray[1]) <= limit) {
                *ray = self.ray_or_nan(grid.pixel(column, row));
            }
        }
    }

    /// Distorted coordinates of rays in `scratch.state`, and their derivatives by (x, y) in `scratch.total`.
    fn distort_batch(&self, rays: &[[f64; 2]], scratch: &mut RowScratch) {
        let n = rays.len();
        scratch.state.clear();
        scratch.state.extend(rays.iter().flat_map(|r| [r[0], r[1], 1e-3, r[0], r[1]]));
        scratch.total.clear();
        scratch.total.extend((0..n).flat_map(|_| [1.0, 0.0, 0.0, 1.0]));
        scratch.out.resize(2 * n, 0.0);
        scratch.d.resize(10 * n, 0.0);
        for (piece, theta) in self.of(HookKind::Lens) {
            piece.linearize(theta, &scratch.state, &scratch.contexts, &mut scratch.out, &mut scratch.d, None);
            let rows = scratch.total.chunks_exact_mut(4).zip(scratch.d.chunks_exact(10));
            for ((total, d), (state, out)) in
                rows.zip(scratch.state.chunks_exact_mut(5).zip(scratch.out.chunks_exact(2)))
            {
                let t: [f64; 4] = std::array::from_fn(|i| {
                    let (r, c) = (5 * (i / 2), i % 2);
                    d[r + c] + d[r + 3] * total[c] + d[r + 4] * total[2 + c]
                });
                total.copy_from_slice(&t);
                state[3..5].copy_from_slice(out);
            }
        }
    }

    /// True inverse depths (1/mm) of measured ones (1/mm) on given true rays, as [`Camera::true_inverse_depth`] gives them for
    /// each; NaN where the model cannot be inverted. All slices have the same length.
    pub fn true_inverse_depths(
        &self,
        contexts: &[Context],
        rays: &[[f64; 2]],
        cos_incidence: &[f64],
        measured: &[f64],
        out: &mut [f64],
    ) {
        out.copy_from_slice(measured);
        if self.of(HookKind::Depth).next().is_none() {
            return;
        }
        const CHUNK: usize = 256;
        let mut scratch = DepthScratch::default();
        for start in (0..out.len()).step_by(CHUNK) {
            let part = start..(start + CHUNK).min(out.len());
            let given = (&contexts[part.clone()], &rays[part.clone()], &cos_incidence[part.clone()]);
            self.invert_chunk(given, &measured[part.clone()], &mut out[part], &mut scratch);
        }
    }

    fn invert_chunk(
        &self,
        (contexts, rays, cos_incidence): (&[Context], &[[f64; 2]], &[f64]),
        measured: &[f64],
        rho: &mut [f64],
        scratch: &mut DepthScratch,
    ) {
        let n = rho.len();
        scratch.settled.clear();
        scratch.settled.resize(n, false);
        scratch.lost.clear();
        scratch.lost.resize(n, false);
        scratch.between.clear();
        scratch.between.resize(n, [0.0, f64::INFINITY]);
        scratch.slope.clear();
        scratch.slope.resize(n, 1.0);
        scratch.last.clear();
        scratch.last.resize(n, [f64::NAN; 2]);
        scratch.out.resize(n, 0.0);
        scratch.d.resize(4 * n, 0.0);
        for step in 0..MOST_STEPS {
            scratch.state.clear();
            let states = rays.iter().zip(&*rho).zip(cos_incidence);
            scratch.state.extend(states.flat_map(|((ray, rho), cos)| [ray[0], ray[1], *rho, *cos]));
            for (piece, theta) in self.of(HookKind::Depth) {
                // Slopes once by derivatives, then by differences, which cost a fraction.
                if step == 0 {
                    piece.linearize(theta, &scratch.state, contexts, &mut scratch.out, &mut scratch.d, None);
                    let slopes = scratch.slope.iter_mut().zip(scratch.d.chunks_exact(4));
                    slopes.for_each(|(slope, d)| *slope *= d[2]);
                } else {
                    piece.evaluate(theta, &scratch.state, contexts, &mut scratch.out);
                }
                let values = scratch.state.chunks_exact_mut(4).zip(&scratch.out);
                values.for_each(|(state, out)| state[2] = *out);
            }
            let mut open = 0;
            for k in 0..n {
                if scratch.settled[k] || scratch.lost[k] {
                    continue;
                }
                let value = scratch.state[4 * k + 2];
                let [last_rho, last_value] = scratch.last[k];
                // Differences far above rounding errors; NaN in the first step.
                if (rho[k] - last_rho).abs() > SECANT * rho[k] {
                    let secant = (value - last_value) / (rho[k] - last_rho);
                    // Where the slope changes by much there may be a fold, which the method for single pixels knows.
                    scratch.lost[k] = !(secant > 0.5 * scratch.slope[k] && secant < 2.0 * scratch.slope[k]);
                    scratch.slope[k] = secant;
                }
                scratch.last[k] = [rho[k], value];
                let slope = scratch.slope[k];
                let tolerance = DEPTH_SETTLED * measured[k].abs();
                if !(slope > 0.0) || scratch.lost[k] {
                    scratch.lost[k] = true;
                } else if (value - measured[k]).abs() <= tolerance {
                    scratch.settled[k] = true;
                    // An inverse depth that is indistinguishable from zero is an infinite depth.
                    scratch.lost[k] = !(rho[k] * slope > 10.0 * tolerance);
                } else {
                    // Between these the solution lies; steps that leave them are left to the method for single pixels.
                    let [low, high] = &mut scratch.between[k];
                    *(if value < measured[k] { low } else { high }) = rho[k];
                    rho[k] += (measured[k] - value) / slope;
                    scratch.lost[k] = !(rho[k] > scratch.between[k][0] && rho[k] < scratch.between[k][1]);
                    open += usize::from(!scratch.lost[k]);
                }
            }
            if open == 0 {
                break;
            }
        }
        for k in 0..n {
            if scratch.lost[k] || !scratch.settled[k] {
                let single = self.true_inverse_depth(&contexts[k], rays[k], cos_incidence[k], measured[k]);
                rho[k] = single.unwrap_or(f64::NAN);
            }
        }
    }
}

/// Evenly spaced pixels of an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PixelGrid {
    /// Column and row of the first pixel, px.
    pub first: [f64; 2],
    /// Distance of neighbours, px.
    pub step: f64,
    /// Number of columns.
    pub columns: usize,
    /// Number of rows.
    pub rows: usize,
}

impl PixelGrid {
    /// The pixel in a column and row of the grid, px.
    pub fn pixel(&self, column: usize, row: usize) -> [f64; 2] {
        [self.first[0] + self.step * column as f64, self.first[1] + self.step * row as f64]
    }
}

/// Memory of [`Camera::rays_of_grid`].
#[derive(Default)]
struct RowScratch {
    contexts: Vec<Context>,
    state: Vec<f64>,
    total: Vec<f64>,
    out: Vec<f64>,
    d: Vec<f64>,
    step: Vec<f64>,
}

/// Memory of [`Camera::true_inverse_depths`].
#[derive(Default)]
struct DepthScratch {
    state: Vec<f64>,
    slope: Vec<f64>,
    out: Vec<f64>,
    d: Vec<f64>,
    settled: Vec<bool>,
    lost: Vec<bool>,
    between: Vec<[f64; 2]>,
    /// Inverse depth and value of the step before.
    last: Vec<[f64; 2]>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{PieceSpec, Register};

    fn camera(pieces: &[(&str, &[f64])]) -> Camera {
        let register = Register::builtin();
        let blocks = pieces.iter().map(|(name, theta)| {
            let mut block = register.make(&PieceSpec::new(*name), None).unwrap();
            block.theta.copy_from_slice(theta);
            block
        });
        Camera::new(160, 120, [120.0, 121.0, 80.3, 60.2, 0.4], blocks.collect())
    }

    /// A barrel lens with a tilted sensor, over the whole image; beyond the lens' limit both are NaN.
    #[test]
    fn rays_of_a_grid_are_those_of_single_pixels() {
        for k1 in [-0.2, 0.15, -0.6] {
            let lens = [k1, 0.05, 1e-3, -8e-4, 0.0];
            let camera = camera(&[("brown_conrady", &lens), ("tilted_sensor", &[0.02, -0.01])]);
            assert!(camera.has_fixed_rays());
            let grid = PixelGrid { first: [-3.0, -2.5], step: 1.5, columns: 110, rows: 82 };
            assert_eq!(grid.pixel(4, 2), [3.0, 0.5]);
            for (i, ray) in camera.rays_of_grid(&grid).iter().enumerate() {
                let single = camera.ray(grid.pixel(i % grid.columns, i / grid.columns), 1e-3);
                match single {
                    Ok(single) => {
                        let off = (ray[0] - single[0]).abs().max((ray[1] - single[1]).abs());
                        assert!(off < 1e-11, "k1 {k1}, pixel {i}: {ray:?} {single:?}");
                    }
                    Err(_) => assert!(ray[0].is_nan(), "k1 {k1}, pixel {i}: {ray:?}"),
                }
            }
        }
    }

    #[test]
    fn a_lens_that_breathes_has_no_fixed_rays() {
        assert!(
            !camera(&[("brown_conrady", &[0.1, 0.0, 0.0, 0.0, 0.0]), ("focus_breathing", &[2.0])]).has_fixed_rays()
        );
        assert!(camera(&[("focus_breathing", &[0.0])]).has_fixed_rays(), "at zero it does not breathe");
    }

    /// Depth pieces in a stack, and one that folds within the range: the batch accepts and refuses as single pixels do.
    #[test]
    fn batches_of_depth_are_inverted_as_single_pixels_are() {
        let stacks: [&[(&str, &[f64])]; 3] = [
            &[("projective", &[1e-5, -2e-5, 3e-5, 1.02])],
            &[("cyclic_depth", &[4.0, 3.0, 0.0, 0.0]), ("projective", &[1e-5, -2e-5, 3e-5, 0.98])],
            &[("cyclic_depth", &[60.0, 30.0, 0.0, 0.0])],
        ];
        let mut refused = 0;
        for stack in stacks {
            let camera = camera(stack);
            let n = 700;
            let spread = |i: usize, step: usize| (i * step % n) as f64 / n as f64;
            let contexts = vec![Context::default(); n];
            let rays: Vec<[f64; 2]> = (0..n).map(|i| [spread(i, 13) - 0.5, spread(i, 29) - 0.5]).collect();
            let cos: Vec<f64> = (0..n).map(|i| 1.0 - 0.5 * spread(i, 17)).collect();
            let measured: Vec<f64> = (0..n).map(|i| 1.0 / (300.0 + 3000.0 * spread(i, 31))).collect();
            let mut out = vec![0.0; n];
            camera.true_inverse_depths(&contexts, &rays, &cos, &measured, &mut out);
            for i in 0..n {
                match camera.true_inverse_depth(&contexts[i], rays[i], cos[i], measured[i]) {
                    Ok(single) => assert!((out[i] / single - 1.0).abs() < 1e-12, "{stack:?} {i}: {} {single}", out[i]),
                    Err(_) => {
                        refused += 1;
                        assert!(out[i].is_nan(), "{stack:?} {i}: {}", out[i]);
                    }
                }
            }
        }
        assert!(refused > 0, "no depth is refused: the test shows nothing of folds");
    }
}
