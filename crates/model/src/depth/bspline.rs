use crate::field::{Field, Grid};
use crate::hook::{Depth, DepthState};
use crate::piece::{Context, Options, Parameter, Piece, Scalar};

/// Inverse depth with an offset and a scale at every pixel. D is the special case whose a is affine in the ray and whose b is
/// constant.
#[derive(Debug, Clone, Copy)]
pub struct Bspline;

impl Bspline {
    /// Cubic tensor B-splines over the image, with 8 × 6 coefficients each unless `options` say otherwise.
    pub fn field(options: &Options) -> Field<Self, 2> {
        Field::new(Self, Grid::cubic(8, 6).with_options(options))
    }
}

impl Piece<Depth, 2> for Bspline {
    const NAME: &'static str = "bspline";
    const SUMMARY: &'static str = "a smooth map over the image, which corrects but explains nothing";
    const EQUATION: &'static str = "ρ + a(u, v) + b(u, v) ρ";
    const SOURCE: &'static str = "proposed for comparison by Sjöholm 2017, section 7.2; splines: de Boor 1978";
    const PARAMETERS: [Parameter; 2] = [
        Parameter::new("a", "1/mm", 0.0, 1e-5).meaning("Offset of inverse depth around this node."),
        Parameter::new("b", "1", 0.0, 1e-2).meaning("Change of the scale of inverse depth around this node."),
    ];

    #[inline(always)]
    fn map<T: Scalar>(&self, s: DepthState<T>, [a, b]: [T; 2], _: &Context) -> T {
        s.rho + a + b * s.rho
    }
}
