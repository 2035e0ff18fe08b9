use crate::field::{Field, Grid};
use crate::hook::{Depth, DepthState};
use crate::piece::{Context, Options, Parameter, Piece, Scalar};

/// Depth as a quadratic of depth whose coefficients vary smoothly over the image.
#[derive(Debug, Clone, Copy)]
pub struct PolynomialMap;

impl PolynomialMap {
    /// Cubic B-splines over the image, with 6 × 5 coefficients each unless `options` say otherwise.
    pub fn field(options: &Options) -> Field<Self, 3> {
        Field::new(Self, Grid::cubic(6, 5).with_options(options))
    }
}

impl Piece<Depth, 3> for PolynomialMap {
    const NAME: &'static str = "polynomial_map";
    const SUMMARY: &'static str = "a map of quadratics in depth, which corrects but explains nothing";
    const EQUATION: &'static str = "z + c0(u, v) + c1(u, v) z + c2(u, v) z²";
    const SOURCE: &'static str =
        "Basso, Menegatti, Pretto 2018, Robust intrinsic and extrinsic calibration of RGB-D cameras";
    const PARAMETERS: [Parameter; 3] = [
        Parameter::new("c0", "mm", 0.0, 5.0).meaning("Offset of depth around this node."),
        Parameter::new("c1", "1", 0.0, 1e-2).meaning("Change of the scale of depth around this node."),
        Parameter::new("c2", "1/mm", 0.0, 1e-5).meaning("Error that grows with the square of depth, around this node."),
    ];

    #[inline(always)]
    fn map<T: Scalar>(&self, s: DepthState<T>, [c0, c1, c2]: [T; 3], _: &Context) -> T {
        // z_m = z (1 + c0 ρ + c1 + c2 / ρ).
        s.rho / (c0 * s.rho + c1 + c2 * s.rho.recip() + 1.0)
    }
}
