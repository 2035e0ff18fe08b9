//! A depth piece with its parameters, and its inverse where that has a closed form.

use std::sync::Arc;

use depthcal_model::{AnyPiece, Context};

use super::classify::{Observation, Shape, affine, affine_at};
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

    /// Measured inverse depths (1/mm) of observations.
    pub fn measured_of(&self, observations: &[Observation]) -> Vec<f64> {
        let states: Vec<f64> = observations.iter().flat_map(|o| [o.ray[0], o.ray[1], o.rho, o.cosine]).collect();
        let contexts: Vec<Context> = observations.iter().map(|o| o.context).collect();
        let mut out = vec![0.0; observations.len()];
        self.piece.evaluate(&self.theta, &states, &contexts, &mut out);
        out
    }

    /// Its inverse, from measured to true depth in mm, as a Möbius map. Exact where the piece is affine in depth or in
    /// inverse depth.
    pub fn inverse(&self, context: &Context, ray: [f64; 2], cosine: f64) -> Matrix {
        self.inverse_of(affine_at(self.shape).map(|rho| self.measured(context, ray, cosine, rho)))
    }

    /// Its inverses at pixels with the given contexts and rays, at a cosine of 1: those of [`Self::inverse`].
    pub fn inverses(&self, pixels: impl Iterator<Item = (Context, [f64; 2])>) -> impl Iterator<Item = Matrix> {
        let rhos = affine_at(self.shape);
        let observations: Vec<Observation> =
            pixels.flat_map(|(context, ray)| rhos.map(|rho| Observation { context, ray, cosine: 1.0, rho })).collect();
        let measured = self.measured_of(&observations);
        (0..measured.len() / 2).map(move |i| self.inverse_of([measured[2 * i], measured[2 * i + 1]]))
    }

    fn inverse_of(&self, measured: [f64; 2]) -> Matrix {
        let coefficients = affine(self.shape, measured);
        match (self.shape, coefficients) {
            (Shape::AffineInInverse, [a, b]) => [b, 0.0, -a, 1.0],
            (_, [m, c]) => [1.0, -c, 0.0, m],
        }
    }

    /// m and c (mm) of z_m = m z + c, for a piece that is affine in depth and does not depend on the pixel.
    pub fn affine_in_depth(&self, context: &Context, cosine: f64) -> [f64; 2] {
        let shape = Shape::AffineInDepth;
        affine(shape, affine_at(shape).map(|rho| self.measured(context, [0.0; 2], cosine, rho)))
    }
}
