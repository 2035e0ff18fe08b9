//! A camera: the pieces of its chain with the values of their parameters.

use std::ops::Range;
use std::sync::Arc;

use nalgebra::Vector3;
use thiserror::Error;

use crate::block::Block;
use crate::chain::Chain;
use crate::grid::nodes::Domain;
use crate::hook::HookKind;
use crate::piece::{AnyPiece, Context, Of};
use crate::pinhole::PINHOLE;

/// Reason why a camera maps no ray to a pixel, or no depth to a depth.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum CameraError {
    /// The lens maps no ray to this pixel in the region where it is one-to-one.
    #[error(
        "pixel ({u:.1}, {v:.1}) lies outside the region where the lens model is one-to-one (radius {limit:.3} on the \
         normalised image plane)"
    )]
    OutsideLens {
        /// Column, px.
        u: f64,
        /// Row, px.
        v: f64,
        /// Largest undistorted radius at which the map is still monotone.
        limit: f64,
    },
    /// The depth model folds: more than one true depth gives the measured one.
    #[error("the depth model '{model}' cannot be inverted at pixel ({u:.1}, {v:.1}) for a depth of {depth_mm:.1} mm")]
    NotInvertible {
        /// The depth pieces.
        model: String,
        /// Column, px.
        u: f64,
        /// Row, px.
        v: f64,
        /// Measured depth where it was to be corrected, true depth where the fold was looked for, mm.
        depth_mm: f64,
    },
}

/// A depth camera.
#[derive(Debug, Clone)]
pub struct Camera {
    /// Width of its images, px.
    pub width: usize,
    /// Height, px.
    pub height: usize,
    blocks: Vec<Block>,
    lens_limit: f64,
}

/// Largest normalised radius that is ever considered: 85° off axis.
const WIDEST_RADIUS: f64 = 11.43;

impl Camera {
    /// A camera from its pinhole (fx, fy, cx, cy, skew, px) and pieces, which are put into the chain's order.
    pub fn new(width: usize, height: usize, pinhole: [f64; PINHOLE], pieces: Vec<Block>) -> Self {
        Self::from_blocks(width, height, Block::pinhole(pinhole), pieces)
    }

    /// A camera like that of [`Camera::new`], from a pinhole block whose free parameters have been chosen.
    pub fn from_blocks(width: usize, height: usize, pinhole: Block, pieces: Vec<Block>) -> Self {
        Self::assemble(width, height, pinhole, pieces).0
    }

    /// A camera like that of [`Camera::from_blocks`], with the index in [`Camera::blocks`] of each of `pieces`, in the order
    /// given. The index is the only way to find a block again: fields are laid over the camera's image and are then other pieces
    /// than those given, and several pieces may have one name.
    pub fn assemble(width: usize, height: usize, pinhole: Block, pieces: Vec<Block>) -> (Self, Vec<usize>) {
        let domain = Domain { size_px: [width as f64, height as f64], depth_mm: None };
        let count = pieces.len();
        let mut blocks: Vec<(usize, Block)> =
            pieces.into_iter().map(|block| block.over(&domain)).chain([pinhole]).enumerate().collect();
        let rank = |b: &Block| match (b.hook(), b.piece().is_some()) {
            (HookKind::Board | HookKind::Pose, _) => 0,
            (HookKind::Lens, _) if b.piece().is_some_and(|p| p.acts_first()) => 1,
            (HookKind::Lens, _) => 2,
            (HookKind::Pixel, false) => 3,
            (HookKind::Pixel, true) => 4,
            (HookKind::Depth, _) if b.placement().of == Of::True => 5,
            (HookKind::Depth, _) => 6,
        };
        blocks.sort_by_key(|(_, block)| rank(block));
        let mut places = vec![0; count];
        for (place, (given, _)) in blocks.iter().enumerate() {
            if let Some(of_piece) = places.get_mut(*given) {
                *of_piece = place;
            }
        }
        let blocks = blocks.into_iter().map(|(_, block)| block).collect();
        let mut camera = Self { width, height, blocks, lens_limit: WIDEST_RADIUS };
        camera.lens_limit = camera.monotone_radius();
        (camera, places)
    }

    /// All parameter blocks in the chain's order, the pinhole among them.
    pub fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    /// The first block of that name.
    pub fn block(&self, name: &str) -> Option<&Block> {
        self.blocks.iter().find(|b| b.name() == name)
    }

    /// The index in [`Camera::blocks`] of the first block of that name.
    pub fn block_index(&self, name: &str) -> Option<usize> {
        self.blocks.iter().position(|b| b.name() == name)
    }

    /// For every block the range of its parameters in [`Camera::theta`], and in rows and columns of a covariance of all
    /// parameters.
    pub fn parameter_ranges(&self) -> impl Iterator<Item = Range<usize>> {
        self.blocks.iter().scan(0, |start, block| {
            let first = std::mem::replace(start, *start + block.theta.len());
            Some(first..*start)
        })
    }

    /// All blocks with their [`Camera::parameter_ranges`].
    pub fn blocks_with_ranges(&self) -> impl Iterator<Item = (&Block, Range<usize>)> {
        self.blocks.iter().zip(self.parameter_ranges())
    }

    /// fx, fy, cx, cy, skew in px.
    pub fn pinhole(&self) -> [f64; PINHOLE] {
        let block = self.blocks.iter().find(|b| b.piece().is_none());
        block.map_or([f64::NAN; PINHOLE], |b| std::array::from_fn(|i| b.theta[i]))
    }

    /// The chain of its pieces, without values.
    pub fn chain(&self) -> Chain {
        let pieces: Vec<_> = self.blocks.iter().filter_map(|b| b.piece().cloned()).collect();
        Chain::new(&pieces)
    }

    /// Places of the free parameters among those of [`Camera::theta`], in order.
    pub fn free_parameters(&self) -> Vec<usize> {
        let free = self.blocks.iter().flat_map(|b| b.free.iter().copied());
        free.enumerate().filter(|(_, free)| *free).map(|(i, _)| i).collect()
    }

    /// All parameter values in the chain's order.
    pub fn theta(&self) -> Vec<f64> {
        self.blocks.iter().flat_map(|b| b.theta.iter().copied()).collect()
    }

    /// A copy with other parameter values, in the order of [`Camera::theta`].
    pub fn with_theta(&self, theta: &[f64]) -> Self {
        let mut camera = self.clone();
        let mut values = theta;
        for block in &mut camera.blocks {
            let (block_values, after) = values.split_at(block.theta.len());
            block.theta.copy_from_slice(block_values);
            values = after;
        }
        camera.lens_limit = camera.monotone_radius();
        camera
    }

    /// A copy with the blocks that `keep` accepts; the pinhole always stays. Indices of later blocks move.
    pub fn filtered(&self, keep: impl Fn(&Block) -> bool) -> Self {
        let mut camera = self.clone();
        camera.blocks.retain(|b| b.piece().is_none() || keep(b));
        camera.lens_limit = camera.monotone_radius();
        camera
    }

    /// A copy with every block changed by `change`, which must keep the hook; indices stay.
    pub fn map_blocks(&self, change: impl FnMut(Block) -> Block) -> Self {
        let mut camera = self.clone();
        camera.blocks = camera.blocks.into_iter().map(change).collect();
        camera.lens_limit = camera.monotone_radius();
        camera
    }

    /// A copy with one more piece, after those of the same hook.
    pub fn with_block(&self, block: Block) -> Self {
        let pinhole = self.blocks.iter().find(|b| b.piece().is_none()).cloned();
        let pinhole = pinhole.unwrap_or_else(|| Block::pinhole([f64::NAN; PINHOLE]));
        let mut pieces: Vec<Block> = self.blocks.iter().filter(|b| b.piece().is_some()).cloned().collect();
        pieces.push(block);
        Self::from_blocks(self.width, self.height, pinhole, pieces)
    }

    pub(crate) fn of(&self, hook: HookKind) -> impl Iterator<Item = (&Arc<dyn AnyPiece>, &[f64])> {
        self.blocks.iter().filter(move |b| b.hook() == hook).filter_map(|b| b.piece().map(|p| (p, b.theta.as_slice())))
    }

    /// Distorted normalised coordinates of a ray, and their derivative by (x, y): [∂x'/∂x, ∂x'/∂y, ∂y'/∂x, ∂y'/∂y].
    fn distort(&self, x: f64, y: f64, rho: f64) -> ([f64; 2], [f64; 4]) {
        let mut state = [x, y, rho, x, y];
        let mut total = [1.0, 0.0, 0.0, 1.0];
        for (piece, theta) in self.of(HookKind::Lens) {
            let (mut out, mut d) = ([0.0; 2], [0.0; 10]);
            piece.linearize(theta, &state, &[Context::default()], &mut out, &mut d, None);
            total = std::array::from_fn(|i| {
                let (r, c) = (5 * (i / 2), i % 2);
                d[r + c] + d[r + 3] * total[c] + d[r + 4] * total[2 + c]
            });
            (state[3], state[4]) = (out[0], out[1]);
        }
        ([state[3], state[4]], total)
    }

    /// The largest radius of undistorted rays within which the lens is one-to-one along every direction.
    fn monotone_radius(&self) -> f64 {
        const DIRECTIONS: usize = 16;
        const STEP: f64 = 0.02;
        /// Beyond this radius steps grow with it.
        const EVEN: f64 = 3.0;
        if self.of(HookKind::Lens).next().is_none() {
            return WIDEST_RADIUS;
        }
        let direction = |i: usize| (std::f64::consts::TAU * i as f64 / DIRECTIONS as f64).sin_cos();
        let limit = (0..DIRECTIONS).map(direction).map(|(s, c)| {
            let folds = |r: &f64| {
                let (_, d) = self.distort(r * c, r * s, 1e-3);
                let along = c * (d[0] * c + d[1] * s) + s * (d[2] * c + d[3] * s);
                !(along > 0.0 && d[0] * d[3] - d[1] * d[2] > 0.0)
            };
            let next = |r: &f64| Some(r + STEP * (r / EVEN).max(1.0)).filter(|r| *r < WIDEST_RADIUS);
            let radii = std::iter::successors(Some(0.0), next).chain([WIDEST_RADIUS]);
            let mut last = 0.0;
            for r in radii {
                if folds(&r) {
                    return last;
                }
                last = r;
            }
            last
        });
        limit.fold(WIDEST_RADIUS, f64::min)
    }

    /// Where a point of the nominal board (mm) lies on the real one, board frame, mm: the board pieces.
    pub fn board_point(&self, [x, y]: [f64; 2]) -> [f64; 3] {
        let mut point = [x, y, 0.0];
        for (piece, theta) in self.of(HookKind::Board) {
            let state = point;
            piece.evaluate(theta, &state, &[Context::default()], &mut point);
        }
        point
    }

    /// Radius on the normalised image plane up to which the lens is one-to-one.
    pub fn lens_limit(&self) -> f64 {
        self.lens_limit
    }

    /// Image pixel of a point in the camera frame (mm); `None` behind the camera or where the lens model folds.
    pub fn project(&self, point_in_camera: &Vector3<f64>) -> Option<[f64; 2]> {
        if !(point_in_camera.z > 0.0) {
            return None;
        }
        let rho = 1.0 / point_in_camera.z;
        let (x, y) = (point_in_camera.x * rho, point_in_camera.y * rho);
        if !(x.hypot(y) <= self.lens_limit) {
            return None;
        }
        let [fx, fy, cx, cy, skew] = self.pinhole();
        let ([x, y], _) = self.distort(x, y, rho);
        Some([fx * x + skew * y + cx, fy * y + cy])
    }

    /// True ray (X/Z, Y/Z) of an image pixel at inverse depth `rho` (1/mm; only a lens that breathes depends on it).
    ///
    /// # Errors
    ///
    /// [`CameraError::OutsideLens`] where the lens model has no inverse.
    pub fn ray(&self, pixel: [f64; 2], rho: f64) -> Result<[f64; 2], CameraError> {
        self.ray_near(pixel, rho, None)
    }

    /// [`Camera::ray`] from a ray that is nearly right, which saves most of Newton's steps.
    ///
    /// # Errors
    ///
    /// [`CameraError::OutsideLens`] where the lens model has no inverse.
    pub fn ray_near(&self, [u, v]: [f64; 2], rho: f64, start: Option<[f64; 2]>) -> Result<[f64; 2], CameraError> {
        let [fx, fy, cx, cy, skew] = self.pinhole();
        let yd = (v - cy) / fy;
        let xd = (u - cx - skew * yd) / fx;
        let outside = || CameraError::OutsideLens { u, v, limit: self.lens_limit };
        let [mut x, mut y] = start.unwrap_or([xd, yd]);
        for _ in 0..50 {
            let ([px, py], d) = self.distort(x, y, rho);
            let (ex, ey) = (xd - px, yd - py);
            let det = d[0] * d[3] - d[1] * d[2];
            let monotone = det > 0.0 && x.hypot(y) <= self.lens_limit;
            let step = if monotone {
                [(d[3] * ex - d[1] * ey) / det, (d[0] * ey - d[2] * ex) / det]
            } else {
                // Newton's step means nothing here: walk back towards the axis.
                [-0.1 * x, -0.1 * y]
            };
            x += step[0];
            y += step[1];
            if !(x.is_finite() && y.is_finite()) {
                return Err(outside());
            }
            // Newton's method squares the error: what such a step leaves is below rounding.
            if monotone && step[0].abs().max(step[1].abs()) < 1e-8 * (1.0 + x * x + y * y) {
                return if x.hypot(y) <= self.lens_limit { Ok([x, y]) } else { Err(outside()) };
            }
        }
        Err(outside())
    }

    /// True ray and true inverse depth (1/mm) from a measured inverse depth at a pixel of the depth image: the inverse
    /// of lens, pixel and depth pieces.
    ///
    /// # Errors
    ///
    /// [`CameraError::OutsideLens`], [`CameraError::NotInvertible`].
    pub fn correct(
        &self,
        context: &Context,
        cos_incidence: f64,
        measured_inverse_depth: f64,
    ) -> Result<([f64; 2], f64), CameraError> {
        self.correct_near(context, cos_incidence, measured_inverse_depth, None)
    }

    /// [`Camera::correct`] from a ray that is nearly right, where the caller has one.
    ///
    /// # Errors
    ///
    /// [`CameraError::OutsideLens`], [`CameraError::NotInvertible`].
    pub fn correct_near(
        &self,
        context: &Context,
        cos_incidence: f64,
        measured_inverse_depth: f64,
        start: Option<[f64; 2]>,
    ) -> Result<([f64; 2], f64), CameraError> {
        let pixel = self.image_pixel(context);
        let mut rho = measured_inverse_depth;
        let mut ray = self.ray_near(pixel, rho, start)?;
        for _ in 0..20 {
            rho = self.true_inverse_depth(context, ray, cos_incidence, measured_inverse_depth)?;
            // Only a lens that breathes has another ray at another depth.
            let next = self.ray_near(pixel, rho, Some(ray))?;
            if (next[0] - ray[0]).abs().max((next[1] - ray[1]).abs()) <= 1e-14 {
                break;
            }
            ray = next;
        }
        Ok((ray, rho))
    }

    /// The image pixel that a pixel of the depth image sees: the inverse of the pixel pieces.
    pub fn image_pixel(&self, context: &Context) -> [f64; 2] {
        let mut pixel = context.pixel;
        let pieces: Vec<_> = self.of(HookKind::Pixel).collect();
        for (piece, theta) in pieces.into_iter().rev() {
            let target = pixel;
            for _ in 0..20 {
                let (mut out, mut d) = ([0.0; 2], [0.0; 4]);
                piece.linearize(theta, &pixel, &[*context], &mut out, &mut d, None);
                let (e, det) = ([target[0] - out[0], target[1] - out[1]], d[0] * d[3] - d[1] * d[2]);
                let step = [(d[3] * e[0] - d[1] * e[1]) / det, (d[0] * e[1] - d[2] * e[0]) / det];
                pixel = [pixel[0] + step[0], pixel[1] + step[1]];
                if step[0].abs().max(step[1].abs()) < 1e-10 {
                    break;
                }
            }
        }
        pixel
    }

    /// Measured inverse depth (1/mm) of a true one on a given ray.
    pub fn measured_inverse_depth(&self, context: &Context, ray: [f64; 2], cos_incidence: f64, rho: f64) -> f64 {
        self.depth_and_slope(context, ray, cos_incidence, rho).0
    }

    fn depth_and_slope(&self, context: &Context, [x, y]: [f64; 2], cos_incidence: f64, rho: f64) -> (f64, f64) {
        let mut state = [x, y, rho, cos_incidence];
        let mut slope = 1.0;
        for (piece, theta) in self.of(HookKind::Depth) {
            let (mut out, mut d) = ([0.0], [0.0; 4]);
            piece.linearize(theta, &state, &[*context], &mut out, &mut d, None);
            state[2] = out[0];
            slope *= d[2];
        }
        (state[2], slope)
    }

    /// True inverse depth (1/mm) of a measured one on a given true ray: the inverse of the depth pieces alone, for
    /// callers that keep the rays of their pixels.
    ///
    /// # Errors
    ///
    /// [`CameraError::NotInvertible`]: the model folds, or leads to infinity or beyond.
    pub fn true_inverse_depth(
        &self,
        context: &Context,
        ray: [f64; 2],
        cos_incidence: f64,
        measured: f64,
    ) -> Result<f64, CameraError> {
        let folded = || self.not_invertible(context, 1.0 / measured);
        let mut rho = measured;
        // Between these the solution lies; Newton's steps that leave them halve them instead, so that kinks of a
        // piecewise linear field cannot make it cycle.
        let (mut low, mut high) = (0.0, f64::INFINITY);
        for _ in 0..100 {
            let (value, slope) = self.depth_and_slope(context, ray, cos_incidence, rho);
            if !(slope > 0.0) {
                return Err(folded());
            }
            if value < measured {
                low = rho;
            } else {
                high = rho;
            }
            let step = (measured - value) / slope;
            if step.abs() <= 1e-15 * rho.abs() {
                rho += step;
                break;
            }
            let next = rho + step;
            rho = match (next > low && next < high, high.is_finite()) {
                (true, _) => next,
                (false, true) => 0.5 * (low + high),
                (false, false) => 2.0 * rho,
            };
        }
        let (value, slope) = self.depth_and_slope(context, ray, cos_incidence, rho);
        // ρ · slope is known to this tolerance too. Below some multiple of it ρ is indistinguishable from zero, which is an
        // infinite depth: reject it.
        let tolerance = 1e-13 * measured.abs();
        // Where a step raises measured depth, no true depth gives what lies between: the step's place is the answer.
        let in_gap = high.is_finite() && high - low <= 4.0 * f64::EPSILON * high;
        let settled = (value - measured).abs() <= tolerance || in_gap;
        if settled && slope > 0.0 && rho * slope > 10.0 * tolerance { Ok(rho) } else { Err(folded()) }
    }

    fn not_invertible(&self, context: &Context, depth_mm: f64) -> CameraError {
        let names: Vec<&str> = self.of(HookKind::Depth).map(|(piece, _)| piece.name()).collect();
        let [u, v] = context.pixel;
        CameraError::NotInvertible { model: names.join("+"), u, v, depth_mm }
    }

    /// Looks for folds of the depth model on the ray of a pixel: depths at which measured depth does not grow with the true
    /// one, among `steps` depths from `near_mm` to `far_mm`.
    ///
    /// # Errors
    ///
    /// [`CameraError::NotInvertible`] at the first fold, [`CameraError::OutsideLens`] where the pixel has no ray.
    pub fn check_depth_folds(
        &self,
        context: &Context,
        [near_mm, far_mm]: [f64; 2],
        steps: usize,
    ) -> Result<(), CameraError> {
        let pixel = self.image_pixel(context);
        let mut last = f64::INFINITY;
        for i in 0..=steps {
            // Evenly in inverse depth, where the pieces act.
            let t = i as f64 / steps.max(1) as f64;
            let rho = (1.0 - t) / near_mm + t / far_mm;
            let ray = self.ray(pixel, rho)?;
            let (value, slope) = self.depth_and_slope(context, ray, 1.0, rho);
            // Inverse depths fall from one step to the next; steps down between them show in the values alone.
            if !(slope > 0.0 && value > 0.0 && value < last) {
                return Err(self.not_invertible(context, 1.0 / rho));
            }
            last = value;
        }
        Ok(())
    }
}
