use crate::field::{Field, Grid};
use crate::hook::{Depth, DepthState};
use crate::register::Options;
use crate::{Context, Parameter, Piece, Scalar};

/// Inverse depth with an offset and a scale at every pixel: ρ_m = ρ + a(u, v) + b(u, v) ρ.
///
/// D is the special case whose a is affine in the ray and whose b is constant.
#[derive(Debug, Clone, Copy)]
pub struct Bspline;

impl Bspline {
    /// With cubic tensor B-splines over the image, 8 × 6 coefficients each unless said otherwise.
    pub fn field(options: &Options) -> Field<Self, 2> {
        Field::new(Self, Grid::cubic(8, 6).with_options(options))
    }
}

impl Piece<Depth, 2> for Bspline {
    const NAME: &'static str = "bspline";
    const SOURCE: &'static str = "proposed for comparison by Sjöholm 2017, section 7.2; splines: de Boor 1978";
    const PARAMETERS: [Parameter; 2] = [Parameter::new("a", "1/mm", 0.0, 1e-5), Parameter::new("b", "1", 0.0, 1e-2)];

    #[inline(always)]
    fn map<T: Scalar>(&self, s: DepthState<T>, [a, b]: [T; 2], _: &Context) -> T {
        s.rho + a + b * s.rho
    }
}
