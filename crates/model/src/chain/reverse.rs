//! Reverse mode: gradients from a pixel or a measured depth back to the board.

use nalgebra::Vector3;

use super::batch::{Workspace, add_theta};
use super::pieces::{Chain, Pose};
use crate::pinhole::PINHOLE;
use crate::pose::POSE;

/// One observation of a batch.
#[derive(Clone, Copy)]
pub(super) struct Pixel {
    /// Its number in the batch, from 0.
    k: usize,
    /// Whether it is a pixel of the depth image, so that pixel pieces take part.
    in_depth_image: bool,
}

impl Pixel {
    pub(super) fn image(k: usize) -> Self {
        Self { k, in_depth_image: false }
    }

    pub(super) fn depth(k: usize) -> Self {
        Self { k, in_depth_image: true }
    }
}

/// The gradient of a scalar that depends on the pixel and, where a depth is measured, directly on the ray.
#[derive(Clone, Copy)]
pub(super) struct Gradient {
    /// By (u, v), 1 × 2.
    by_pixel: [f64; 2],
    /// By (x, y, ρ) with the pixel held, 1 × 3.
    direct: [f64; 3],
}

impl Gradient {
    /// Of a scalar that depends on the pixel alone.
    pub(super) fn by_pixel(by_pixel: [f64; 2]) -> Self {
        Self { by_pixel, direct: [0.0; 3] }
    }
}

impl Chain {
    /// Adds to `row`, 1 × ([`POSE`] + [`Chain::parameter_count`]) of zeros, the derivative of the measured inverse depth of
    /// observation `k`. `normal` is the board's normal in the camera frame.
    pub(super) fn depth_row(
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
        let pixel = Pixel::depth(k);
        let a = self.backward(work, theta, pose, pixel, Gradient::by_pixel([1.0, 0.0]), None);
        let b = self.backward(work, theta, pose, pixel, Gradient::by_pixel([0.0, 1.0]), None);
        let h = self.backward(work, theta, pose, pixel, Gradient { by_pixel: [0.0, 0.0], direct }, None);
        let det = a[0] * b[1] - a[1] * b[0];
        let lambda = [(h[0] * b[1] - h[1] * b[0]) / det, (a[0] * h[1] - a[1] * h[0]) / det];
        let total = Gradient { by_pixel: [-lambda[0], -lambda[1]], direct };
        self.backward(work, theta, pose, pixel, total, Some(row));
    }

    /// Carries the gradient of a scalar back through the chain to the board, for one observation of the batch (reverse mode).
    ///
    /// - `work`: the chain evaluated by [`Chain::forward`] with derivatives; with those by the parameters where `row` is given;
    /// - `theta`: all parameters without the pose, [`Chain::parameter_count`] numbers;
    /// - `pixel`: the observation of the batch;
    /// - `gradient`: the derivative of the scalar;
    /// - `row`: the row of the Jacobian that is added to, 1 × ([`POSE`] + [`Chain::parameter_count`]) for depth pixels,
    ///   1 × ([`POSE`] + [`Chain::image_parameter_count`]) for image pixels, or 1 × [`POSE`] for the pose alone; columns of depth
    ///   pieces are left alone.
    ///
    /// Returns the gradient by the point (X, Y) of the nominal board, 1 × 2.
    pub(super) fn backward(
        &self,
        work: &Workspace,
        theta: &[f64],
        pose: &Pose,
        pixel: Pixel,
        gradient: Gradient,
        mut row: Option<&mut [f64]>,
    ) -> [f64; 2] {
        let Pixel { k, in_depth_image } = pixel;
        let ray = &work.points[k];
        let mut g = gradient.by_pixel;
        if in_depth_image {
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
        let mut by_ray = gradient.direct;
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
