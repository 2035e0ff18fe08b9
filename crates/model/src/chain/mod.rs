//! The chain of pieces from a board point to a pixel and to a measured inverse depth, with all its derivatives.
//!
//! Every piece is linearised on its own; the rows of the full Jacobian are made backwards, from the pixel (or the
//! measured depth) to the board, so that only 1 × k times k × k products occur. Columns of a row:
//!
//! ```text
//! pose (ω, τ) | board pieces | lens pieces | pinhole fx fy cx cy s | pixel pieces | depth pieces
//! ```
//!
//! The pose's tangent is that of X = R Exp(ω) P' + t + τ. A depth pixel is fixed and the point of the board that it
//! sees is not: that point is found by Newton's method on the forward chain, and its derivative follows from the
//! implicit function theorem, so that every piece (a bent board, a focal length that depends on distance) is treated
//! alike.

mod batch;

use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Vector3};
use thiserror::Error;

use crate::hook::HookKind;
use crate::piece::{AnyPiece, Context};
pub use crate::pinhole::PINHOLE;
pub use crate::pose::POSE;

pub use batch::Workspace;
use batch::{Derive, Link, Ray, add_theta, links, run};

/// Observations that are carried through the pieces together: one virtual call per piece and batch.
const BATCH: usize = 64;
/// A point nearer than this to the camera's centre has no image.
const NEAREST_MM: f64 = 1e-3;
/// Newton's method for the board point of a depth pixel stops here, px.
const PIXEL_TOLERANCE: f64 = 1e-9;
/// Most rounds of Newton's method.
const NEWTON_ROUNDS: usize = 100;
/// Rounds of Newton's method with the same derivative.
const ROUNDS_PER_DERIVATIVE: usize = 4;

/// Reason why a chain has no value.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum ChainError {
    /// A board point lies behind the camera.
    #[error("board point ({x:.1}, {y:.1}) mm lies behind the camera (z = {z:.3} mm)")]
    BehindCamera {
        /// Board x, mm.
        x: f64,
        /// Board y, mm.
        y: f64,
        /// Its z in the camera frame, mm.
        z: f64,
    },
    /// The ray of a depth pixel does not meet the board within the chain's domain.
    #[error("the ray of depth pixel ({u:.2}, {v:.2}) does not meet the board")]
    NoIntersection {
        /// Column, px.
        u: f64,
        /// Row, px.
        v: f64,
    },
}

/// A depth pixel that lies on the board.
#[derive(Debug, Clone, Copy)]
pub struct DepthQuery {
    /// Roughly which board point it sees, mm: where Newton's method starts.
    pub board_seed: [f64; 2],
    /// The pixel and its covariates.
    pub context: Context,
}

/// The pieces of a camera in order. Their parameters are not here: every call is given them as one slice, `theta`, in
/// the order of the columns above without the pose ([`Chain::parameter_count`] numbers).
#[derive(Debug, Clone, Default)]
pub struct Chain {
    board: Vec<Link>,
    lens: Vec<Link>,
    pixel: Vec<Link>,
    depth: Vec<Link>,
    pinhole_offset: usize,
    total: usize,
}

/// A frame's pose, ready for use.
#[derive(Clone, Copy)]
struct Pose {
    rotation: Matrix3<f64>,
    translation: Vector3<f64>,
}

impl From<&Isometry3<f64>> for Pose {
    fn from(camera_from_board: &Isometry3<f64>) -> Self {
        Self {
            rotation: camera_from_board.rotation.to_rotation_matrix().into_inner(),
            translation: camera_from_board.translation.vector,
        }
    }
}

impl Chain {
    /// Puts pieces into the chain's order; within a hook the given order is kept. Pieces at [`HookKind::Pose`] do not
    /// exist: the pose is the frame's own variable.
    pub fn new(pieces: &[Arc<dyn AnyPiece>]) -> Self {
        let mut offset = 0;
        let board = links(pieces, HookKind::Board, &mut offset);
        let lens = links(pieces, HookKind::Lens, &mut offset);
        let pinhole_offset = offset;
        offset += PINHOLE;
        let pixel = links(pieces, HookKind::Pixel, &mut offset);
        let depth = links(pieces, HookKind::Depth, &mut offset);
        Self { board, lens, pixel, depth, pinhole_offset, total: offset }
    }

    /// Length of `theta`: all pieces and the pinhole.
    pub fn parameter_count(&self) -> usize {
        self.total
    }

    /// Leading part of `theta` that an image observation depends on: all but pixel and depth pieces.
    pub fn image_parameter_count(&self) -> usize {
        self.pinhole_offset + PINHOLE
    }

    /// Where the pinhole's parameters begin in `theta`.
    pub fn pinhole_offset(&self) -> usize {
        self.pinhole_offset
    }

    /// The pieces in chain order with the place of their first parameter in `theta`.
    pub fn pieces(&self) -> impl Iterator<Item = (&Arc<dyn AnyPiece>, usize)> {
        [&self.board, &self.lens, &self.pixel, &self.depth].into_iter().flatten().map(|l| (&l.piece, l.offset))
    }

    /// Pixels of board points (mm, board frame) in the image; where `jacobian` is given, also its rows: two per point,
    /// [`POSE`] + [`Chain::image_parameter_count`] columns, row-major.
    ///
    /// # Errors
    ///
    /// [`ChainError::BehindCamera`].
    pub fn image(
        &self,
        work: &mut Workspace,
        theta: &[f64],
        camera_from_board: &Isometry3<f64>,
        points: &[[f64; 2]],
        pixels: &mut [[f64; 2]],
        jacobian: Option<&mut [f64]>,
    ) -> Result<(), ChainError> {
        let derive = jacobian.is_some().then_some(Derive::All);
        self.image_rows(work, theta, camera_from_board, points, pixels, jacobian, derive)
    }

    /// [`Chain::image`] with the Jacobian by the pose alone: two rows per point, [`POSE`] columns.
    ///
    /// # Errors
    ///
    /// [`ChainError::BehindCamera`].
    pub fn image_by_pose(
        &self,
        work: &mut Workspace,
        theta: &[f64],
        camera_from_board: &Isometry3<f64>,
        points: &[[f64; 2]],
        pixels: &mut [[f64; 2]],
        jacobian: &mut [f64],
    ) -> Result<(), ChainError> {
        self.image_rows(work, theta, camera_from_board, points, pixels, Some(jacobian), Some(Derive::State))
    }

    #[allow(clippy::too_many_arguments)]
    fn image_rows(
        &self,
        work: &mut Workspace,
        theta: &[f64],
        camera_from_board: &Isometry3<f64>,
        points: &[[f64; 2]],
        pixels: &mut [[f64; 2]],
        mut jacobian: Option<&mut [f64]>,
        derive: Option<Derive>,
    ) -> Result<(), ChainError> {
        let pose = Pose::from(camera_from_board);
        let columns = if derive == Some(Derive::State) { POSE } else { POSE + self.image_parameter_count() };
        for (start, batch) in (0..).step_by(BATCH).zip(points.chunks(BATCH)) {
            work.contexts.clear();
            work.contexts.resize(batch.len(), Context::default());
            work.seeds.clear();
            work.seeds.extend_from_slice(batch);
            self.forward(work, theta, &pose, false, derive)?;
            for (k, ray) in work.points.iter().enumerate() {
                pixels[start + k] = ray.pixel;
                if let Some(jacobian) = jacobian.as_deref_mut() {
                    for (r, g) in [[1.0, 0.0], [0.0, 1.0]].into_iter().enumerate() {
                        let row = &mut jacobian[(2 * (start + k) + r) * columns..][..columns];
                        row.fill(0.0);
                        self.backward(work, theta, &pose, false, k, g, [0.0; 3], Some(row));
                    }
                }
            }
        }
        Ok(())
    }

    /// Measured inverse depth (1/mm) that the chain predicts at depth pixels, and the board points (mm) that they see;
    /// where `jacobian` is given, also its rows: one per pixel, [`POSE`] + [`Chain::parameter_count`] columns.
    ///
    /// # Errors
    ///
    /// [`ChainError::NoIntersection`] where a pixel's ray misses the board, [`ChainError::BehindCamera`].
    #[allow(clippy::too_many_arguments)]
    pub fn depth(
        &self,
        work: &mut Workspace,
        theta: &[f64],
        camera_from_board: &Isometry3<f64>,
        queries: &[DepthQuery],
        inverse_depth: &mut [f64],
        board_points: &mut [[f64; 2]],
        mut jacobian: Option<&mut [f64]>,
    ) -> Result<(), ChainError> {
        let pose = Pose::from(camera_from_board);
        let columns = POSE + self.parameter_count();
        let want = if jacobian.is_some() { Derive::All } else { Derive::State };
        for (start, batch) in (0..).step_by(BATCH).zip(queries.chunks(BATCH)) {
            work.contexts.clear();
            work.contexts.extend(batch.iter().map(|q| q.context));
            work.seeds.clear();
            work.seeds.extend(batch.iter().map(|q| q.board_seed));
            self.intersect(work, theta, &pose)?;
            if want == Derive::All {
                self.forward(work, theta, &pose, true, Some(Derive::All))?;
            }
            self.depth_forward(work, theta, &pose, want);
            let normal = pose.rotation.column(2).into_owned();
            for k in 0..batch.len() {
                inverse_depth[start + k] = work.state[4 * k + 2];
                board_points[start + k] = work.seeds[k];
                if let Some(jacobian) = jacobian.as_deref_mut() {
                    let row = &mut jacobian[(start + k) * columns..][..columns];
                    row.fill(0.0);
                    self.depth_row(work, theta, &pose, &normal, k, row);
                }
            }
        }
        Ok(())
    }

    /// Moves the batch's board points until their pixels are the contexts' pixels; leaves the points evaluated there.
    ///
    /// A derivative of the forward chain serves several rounds: it costs as much as some values, and changes by a thousandth or so over
    /// the few pixels that a start is off.
    fn intersect(&self, work: &mut Workspace, theta: &[f64], pose: &Pose) -> Result<(), ChainError> {
        work.by_pixel.resize(work.seeds.len(), [[0.0; 2]; 2]);
        for round in 0..NEWTON_ROUNDS {
            let derive = (round % ROUNDS_PER_DERIVATIVE == 0).then_some(Derive::State);
            self.forward(work, theta, pose, true, derive)?;
            let mut worst = 0.0_f64;
            for k in 0..work.points.len() {
                let (target, pixel) = (work.contexts[k].pixel, work.points[k].pixel);
                let miss = [target[0] - pixel[0], target[1] - pixel[1]];
                if derive.is_some() {
                    let a = self.backward(work, theta, pose, true, k, [1.0, 0.0], [0.0; 3], None);
                    let b = self.backward(work, theta, pose, true, k, [0.0, 1.0], [0.0; 3], None);
                    let det = a[0] * b[1] - a[1] * b[0];
                    work.by_pixel[k] = [[b[1] / det, -a[1] / det], [-b[0] / det, a[0] / det]];
                }
                // Negated so that NaN counts as a miss.
                if !(miss[0].abs().max(miss[1].abs()) <= PIXEL_TOLERANCE) {
                    worst = if miss[0].is_finite() && miss[1].is_finite() { 1.0 } else { f64::NAN };
                    let [x, y] = work.by_pixel[k];
                    work.seeds[k][0] += x[0] * miss[0] + x[1] * miss[1];
                    work.seeds[k][1] += y[0] * miss[0] + y[1] * miss[1];
                }
                if worst.is_nan() {
                    return Err(ChainError::NoIntersection { u: target[0], v: target[1] });
                }
            }
            if worst == 0.0 {
                return Ok(());
            }
        }
        let missed = work.points.iter().zip(&work.contexts).find(|(ray, context)| {
            (ray.pixel[0] - context.pixel[0]).abs().max((ray.pixel[1] - context.pixel[1]).abs()) > PIXEL_TOLERANCE
        });
        // Rounding at the tolerance's scale is not a miss.
        match missed {
            Some((ray, context))
                if (ray.pixel[0] - context.pixel[0]).hypot(ray.pixel[1] - context.pixel[1]) > 1e3 * PIXEL_TOLERANCE =>
            {
                Err(ChainError::NoIntersection { u: context.pixel[0], v: context.pixel[1] })
            }
            _ => Ok(()),
        }
    }

    /// Evaluates the chain from the board points in `work.seeds` to pixels, with the pieces' own derivatives.
    fn forward(
        &self,
        work: &mut Workspace,
        theta: &[f64],
        pose: &Pose,
        depth_image: bool,
        derive: Option<Derive>,
    ) -> Result<(), ChainError> {
        let n = work.seeds.len();
        work.points.resize(n, Ray::default());
        work.state.clear();
        work.state.extend(work.seeds.iter().flat_map(|w| [w[0], w[1], 0.0]));
        run(&self.board, 3, 3, theta, work, HookKind::Board, derive);
        let mut lens_state = std::mem::take(&mut work.next);
        lens_state.clear();
        for k in 0..n {
            let on_board = [work.state[3 * k], work.state[3 * k + 1], work.state[3 * k + 2]];
            let point_in_camera = pose.rotation * Vector3::from(on_board) + pose.translation;
            // Negated so that NaN is refused too.
            if !(point_in_camera.z > NEAREST_MM) {
                let [x, y] = work.seeds[k];
                work.next = lens_state;
                return Err(ChainError::BehindCamera { x, y, z: point_in_camera.z });
            }
            let rho = 1.0 / point_in_camera.z;
            let (x, y) = (point_in_camera.x * rho, point_in_camera.y * rho);
            work.points[k] = Ray { on_board, x, y, rho, ..Ray::default() };
            lens_state.extend([x, y, rho, x, y]);
        }
        std::mem::swap(&mut work.state, &mut lens_state);
        work.next = lens_state;
        run(&self.lens, 5, 2, theta, work, HookKind::Lens, derive);
        let [fx, fy, cx, cy, skew] = std::array::from_fn(|i| theta[self.pinhole_offset + i]);
        let mut pixel_state = std::mem::take(&mut work.next);
        pixel_state.clear();
        for k in 0..n {
            let [x, y] = [work.state[5 * k + 3], work.state[5 * k + 4]];
            work.points[k].distorted = [x, y];
            pixel_state.extend([fx * x + skew * y + cx, fy * y + cy]);
        }
        std::mem::swap(&mut work.state, &mut pixel_state);
        work.next = pixel_state;
        if depth_image {
            run(&self.pixel, 2, 2, theta, work, HookKind::Pixel, derive);
        }
        for k in 0..n {
            work.points[k].pixel = [work.state[2 * k], work.state[2 * k + 1]];
        }
        Ok(())
    }

    /// Runs the depth pieces on the batch; afterwards `work.state` holds (x, y, ρ_m, cos) per observation.
    fn depth_forward(&self, work: &mut Workspace, theta: &[f64], pose: &Pose, derive: Derive) {
        let normal = pose.rotation.column(2);
        work.state.clear();
        for ray in &work.points {
            let d = Vector3::new(ray.x, ray.y, 1.0);
            work.state.extend([ray.x, ray.y, ray.rho, normal.dot(&d).abs() / d.norm()]);
        }
        let derive = (derive == Derive::All).then_some(Derive::All);
        run(&self.depth, 4, 1, theta, work, HookKind::Depth, derive);
    }

    /// Adds to `row`, 1 × ([`POSE`] + [`Chain::parameter_count`]) of zeros, the derivative of the measured inverse depth of
    /// observation `k`. `normal` is the board's normal in the camera frame.
    fn depth_row(
        &self,
        work: &Workspace,
        theta: &[f64],
        pose: &Pose,
        normal: &Vector3<f64>,
        k: usize,
        row: &mut [f64],
    ) {
        // Depth pieces, last to first: their parameters, and the gradient by (x, y, ρ, cos).
        let (mut g_rho, mut direct, mut g_cos) = (1.0, [0.0; 3], 0.0);
        for (link, local) in self.depth.iter().zip(&work.depth).rev() {
            let columns = &mut row[POSE + link.offset..][..link.count];
            for (c, d) in columns.iter_mut().zip(&local.d_theta[k * link.count..]) {
                *c += g_rho * d;
            }
            let d = &local.d_state[4 * k..4 * k + 4];
            direct[0] += g_rho * d[0];
            direct[1] += g_rho * d[1];
            g_cos += g_rho * d[3];
            g_rho *= d[2];
        }
        direct[2] = g_rho;
        if g_cos != 0.0 {
            // cos = |n·d| / ‖d‖ with d = (x, y, 1) and n = R e₃, which turns with ω: ∂(n·d)/∂ω = e₃ × Rᵀd.
            let ray = &work.points[k];
            let d = Vector3::new(ray.x, ray.y, 1.0);
            let (length, sign) = (d.norm(), normal.dot(&d).signum());
            let cos = sign * normal.dot(&d) / length;
            direct[0] += g_cos * (sign * normal.x / length - cos * d.x / (length * length));
            direct[1] += g_cos * (sign * normal.y / length - cos * d.y / (length * length));
            let by_omega = Vector3::z().cross(&(pose.rotation.tr_mul(&d) * (sign / length)));
            for i in 0..3 {
                row[i] += g_cos * by_omega[i];
            }
        }
        // The pixel stays: dρ = (∂ρ/∂θ − ∂ρ/∂w (∂F/∂w)⁻¹ ∂F/∂θ) dθ, with F the pixel of board point w.
        let a = self.backward(work, theta, pose, true, k, [1.0, 0.0], [0.0; 3], None);
        let b = self.backward(work, theta, pose, true, k, [0.0, 1.0], [0.0; 3], None);
        let h = self.backward(work, theta, pose, true, k, [0.0, 0.0], direct, None);
        let det = a[0] * b[1] - a[1] * b[0];
        let lambda = [(h[0] * b[1] - h[1] * b[0]) / det, (a[0] * h[1] - a[1] * h[0]) / det];
        self.backward(work, theta, pose, true, k, [-lambda[0], -lambda[1]], direct, Some(row));
    }

    /// Carries the gradient of a scalar back through the chain to the board, for one observation of the batch (reverse mode).
    /// The scalar depends on the pixel and, where a depth is measured, directly on the ray.
    ///
    /// - `work`: the chain evaluated by [`Chain::forward`] with derivatives; with those by the parameters where `row` is given;
    /// - `theta`: all parameters without the pose, [`Chain::parameter_count`] numbers;
    /// - `depth_image`: whether the pixel is one of the depth image, so that pixel pieces take part;
    /// - `k`: the observation, less than [`BATCH`];
    /// - `by_pixel`: gradient by (u, v), 1 × 2;
    /// - `direct`: gradient by (x, y, ρ) with the pixel held, 1 × 3;
    /// - `row`: the row of the Jacobian that is added to, 1 × ([`POSE`] + [`Chain::parameter_count`]) for depth pixels,
    ///   1 × ([`POSE`] + [`Chain::image_parameter_count`]) for image pixels, or 1 × [`POSE`] for the pose alone; columns of depth pieces
    ///   are left alone.
    ///
    /// Returns the gradient by the point (X, Y) of the nominal board, 1 × 2.
    #[allow(clippy::too_many_arguments)]
    fn backward(
        &self,
        work: &Workspace,
        theta: &[f64],
        pose: &Pose,
        depth_image: bool,
        k: usize,
        by_pixel: [f64; 2],
        direct: [f64; 3],
        mut row: Option<&mut [f64]>,
    ) -> [f64; 2] {
        let ray = &work.points[k];
        let mut g = by_pixel;
        if depth_image {
            for (link, local) in self.pixel.iter().zip(&work.pixel).rev() {
                add_theta(&mut row, link, local, k, &g);
                let d = &local.d_state[4 * k..4 * k + 4];
                g = [g[0] * d[0] + g[1] * d[2], g[0] * d[1] + g[1] * d[3]];
            }
        }
        if let Some(row) = row.as_deref_mut().filter(|row| row.len() > POSE) {
            let [x, y] = ray.distorted;
            let columns = &mut row[POSE + self.pinhole_offset..][..PINHOLE];
            for (c, d) in columns.iter_mut().zip([g[0] * x, g[1] * y, g[0], g[1], g[0] * y]) {
                *c += d;
            }
        }
        let (fx, fy, skew) =
            (theta[self.pinhole_offset], theta[self.pinhole_offset + 1], theta[self.pinhole_offset + 4]);
        g = [g[0] * fx, g[0] * skew + g[1] * fy];
        let mut by_ray = direct;
        for (link, local) in self.lens.iter().zip(&work.lens).rev() {
            add_theta(&mut row, link, local, k, &g);
            let d = &local.d_state[10 * k..10 * k + 10];
            for i in 0..3 {
                by_ray[i] += g[0] * d[i] + g[1] * d[5 + i];
            }
            g = [g[0] * d[3] + g[1] * d[8], g[0] * d[4] + g[1] * d[9]];
        }
        by_ray[0] += g[0];
        by_ray[1] += g[1];
        let along = ray.x * by_ray[0] + ray.y * by_ray[1] + ray.rho * by_ray[2];
        let by_point = Vector3::new(by_ray[0], by_ray[1], -along) * ray.rho;
        let in_board = pose.rotation.tr_mul(&by_point);
        if let Some(row) = row.as_deref_mut() {
            let by_omega = Vector3::from(ray.on_board).cross(&in_board);
            for i in 0..3 {
                row[i] += by_omega[i];
                row[3 + i] += by_point[i];
            }
        }
        let mut g = [in_board.x, in_board.y, in_board.z];
        for (link, local) in self.board.iter().zip(&work.board).rev() {
            add_theta(&mut row, link, local, k, &g);
            let d = &local.d_state[9 * k..9 * k + 9];
            g = std::array::from_fn(|i| g[0] * d[i] + g[1] * d[3 + i] + g[2] * d[6 + i]);
        }
        [g[0], g[1]]
    }
}
