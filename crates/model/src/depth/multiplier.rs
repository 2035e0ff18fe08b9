use crate::field::{Field, Grid};
use crate::hook::{Depth, DepthState};
use crate::register::Options;
use crate::{Context, Parameter, Piece, Scalar};

/// A grid of depth multipliers over image and depth: z_m = z m(u, v, z), linear between its nodes.
#[derive(Debug, Clone, Copy)]
pub struct Multiplier;

impl Multiplier {
    /// With 8 × 6 nodes over the image and 3 in depth unless said otherwise.
    pub fn field(options: &Options) -> Field<Self, 1> {
        Field::new(Self, Grid::linear(8, 6, 3).with_options(options))
    }
}

impl Piece<Depth, 1> for Multiplier {
    const NAME: &'static str = "multiplier";
    const SOURCE: &'static str =
        "Teichman, Miller, Thrun 2013, Unsupervised intrinsic calibration of depth sensors via SLAM";
    const PARAMETERS: [Parameter; 1] = [Parameter::new("m", "1", 1.0, 1e-2)];

    #[inline(always)]
    fn map<T: Scalar>(&self, s: DepthState<T>, [m]: [T; 1], _: &Context) -> T {
        s.rho / m
    }
}
