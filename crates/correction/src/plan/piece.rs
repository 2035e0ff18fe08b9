//! A depth piece with its parameters, and its inverse where that has a closed form.

use std::sync::Arc;

use depthcal_model::{AnyPiece, Context};

use super::classify::{Shape, affine_in_depth, affine_in_inverse};
use super::moebius::Matrix;

/// A depth piece with its parameters.
#[derive(Debug, Clone)]
pub(crate) struct DepthPiece {
    pub piece: Arc<dyn AnyPiece>,
    pub theta: Vec<f64>,
    pub shape: Shape,
}

impl DepthPiece {
    /// Measured inverse depth (1/mm) at a true one (1/mm), on the ray (x, y) and at the cosine of the angle of
    /// incidence.
    pub fn measured(&self, context: &Context, [x, y]: [f64; 2], cosine: f64, rho: f64) -> f64 {
        let mut out = [0.0];
        self.piece.evaluate(&self.theta, &[x, y, rho, cosine], std::slice::from_ref(context), &mut out);
        out[0]
    }

    /// Its inverse, from measured to true depth in mm, as a Möbius map. Exact where the piece is affine in depth or in
    /// inverse depth.
    pub fn inverse(&self, context: &Context, ray: [f64; 2], cosine: f64) -> Matrix {
        let measured = |rho: f64| self.measured(context, ray, cosine, rho);
        match self.shape {
            Shape::AffineInInverse => {
                let [a, b] = affine_in_inverse(measured);
                [b, 0.0, -a, 1.0]
            }
            _ => {
                let [m, c] = affine_in_depth(measured);
                [1.0, -c, 0.0, m]
            }
        }
    }

    /// m and c (mm) of z_m = m z + c, for a piece that is affine in depth and does not depend on the pixel.
    pub fn affine_in_depth(&self, context: &Context, cosine: f64) -> [f64; 2] {
        affine_in_depth(|rho| self.measured(context, [0.0; 2], cosine, rho))
    }
}
