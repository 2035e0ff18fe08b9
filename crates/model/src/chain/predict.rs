//! Pixels and measured depths that the chain predicts, with their Jacobians.

use nalgebra::Isometry3;

use super::batch::{Derive, Workspace};
use super::error::ChainError;
use super::pieces::{Chain, Pose};
use super::reverse::{Gradient, Pixel};
use crate::piece::Context;
use crate::pose::POSE;

/// Observations that are carried through the pieces together: one virtual call per piece and batch.
const BATCH: usize = 64;
/// Newton's method for the board point of a depth pixel stops here, px.
const PIXEL_TOLERANCE: f64 = 1e-9;
/// Most rounds of Newton's method.
const NEWTON_ROUNDS: usize = 100;
/// Rounds of Newton's method with the same derivative.
const ROUNDS_PER_DERIVATIVE: usize = 4;

/// A depth pixel that lies on the board.
#[derive(Debug, Clone, Copy)]
pub struct DepthQuery {
    /// Roughly which board point it sees, mm: where Newton's method starts.
    pub board_seed: [f64; 2],
    /// The pixel and its covariates.
    pub context: Context,
}

impl Chain {
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
                        self.backward(work, theta, &pose, Pixel::image(k), Gradient::by_pixel(g), Some(row));
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
    /// A derivative of the forward chain serves several rounds: it costs as much as some values, and changes by a thousandth or
    /// so over the few pixels that a start is off.
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
                    let pixel = Pixel::depth(k);
                    let a = self.backward(work, theta, pose, pixel, Gradient::by_pixel([1.0, 0.0]), None);
                    let b = self.backward(work, theta, pose, pixel, Gradient::by_pixel([0.0, 1.0]), None);
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
}
