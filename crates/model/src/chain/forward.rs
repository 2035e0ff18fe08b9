//! From board points to pixels and depths, piece by piece.

use nalgebra::Vector3;

use super::batch::{Derive, Ray, Workspace, run};
use super::error::ChainError;
use super::pieces::{Chain, Pose};
use crate::hook::HookKind;

/// A point nearer than this to the camera's centre has no image.
const NEAREST_MM: f64 = 1e-3;

impl Chain {
    /// Evaluates the chain from the board points in `work.seeds` to pixels, with the pieces' own derivatives.
    pub(super) fn forward(
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
    pub(super) fn depth_forward(&self, work: &mut Workspace, theta: &[f64], pose: &Pose, derive: Derive) {
        let normal = pose.rotation.column(2);
        work.state.clear();
        for ray in &work.points {
            let d = Vector3::new(ray.x, ray.y, 1.0);
            work.state.extend([ray.x, ray.y, ray.rho, normal.dot(&d).abs() / d.norm()]);
        }
        let derive = (derive == Derive::All).then_some(Derive::All);
        run(&self.depth, 4, 1, theta, work, HookKind::Depth, derive);
    }
}
