use crate::field::{Field, Grid};
use crate::hook::{Depth, DepthState};
use crate::piece::{Context, Options, Parameter, Piece, Scalar};

/// An offset of inverse depth that is free over the image. It takes up every error that is constant in ρ at a pixel, so it
/// competes with effects and names no cause.
#[derive(Debug, Clone, Copy)]
pub struct FreeMap;

impl FreeMap {
    /// Cubic B-splines over the image, with 6 × 6 coefficients unless `options` say otherwise.
    pub fn field(options: &Options) -> Field<Self, 1> {
        Field::new(Self, Grid::cubic(6, 6).with_options(options))
    }
}

impl Piece<Depth, 1> for FreeMap {
    const NAME: &'static str = "free_map";
    const SUMMARY: &'static str = "a smooth map over the image, which corrects but explains nothing";
    const EQUATION: &'static str = "ρ + a(u, v)";
    const SOURCE: &'static str = "an offset map; splines: de Boor 1978";
    const PARAMETERS: [Parameter; 1] =
        [Parameter::new("a", "1/mm", 0.0, 1e-5).meaning("Offset of inverse depth around this node.")];
    const OFFSET_MAP: bool = true;

    #[inline(always)]
    fn map<T: Scalar>(&self, s: DepthState<T>, [a]: [T; 1], _: &Context) -> T {
        s.rho + a
    }
}
