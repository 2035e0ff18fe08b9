use crate::field::{Field, Grid};
use crate::hook::{Depth, DepthState};
use crate::register::Options;
use crate::{Context, Parameter, Piece, Scalar};

/// An offset in inverse depth that is free over the image: ρ_m = ρ + a(u, v).
///
/// Never a name for a cause, always a competitor: it takes up every error that is constant in ρ at a pixel.
#[derive(Debug, Clone, Copy)]
pub struct FreeMap;

impl FreeMap {
    /// With cubic B-splines over the image, 6 × 6 coefficients unless said otherwise.
    pub fn field(options: &Options) -> Field<Self, 1> {
        Field::new(Self, Grid::cubic(6, 6).with_options(options))
    }
}

impl Piece<Depth, 1> for FreeMap {
    const NAME: &'static str = "free_map";
    const SOURCE: &'static str = "an offset map; splines: de Boor 1978";
    const PARAMETERS: [Parameter; 1] = [Parameter::new("a", "1/mm", 0.0, 1e-5)];

    #[inline(always)]
    fn map<T: Scalar>(&self, s: DepthState<T>, [a]: [T; 1], _: &Context) -> T {
        s.rho + a
    }
}
