use crate::field::{Field, Grid};
use crate::hook::{Depth, DepthState};
use crate::piece::{Context, Options, Parameter, Piece, Scalar};

/// A grid of depth multipliers over image and depth, linear between its nodes.
#[derive(Debug, Clone, Copy)]
pub struct Multiplier;

impl Multiplier {
    /// 8 × 6 nodes over the image and 3 in depth unless `options` say otherwise.
    pub fn field(options: &Options) -> Field<Self, 1> {
        Field::new(Self, Grid::linear(8, 6, 3).with_options(options))
    }
}

impl Piece<Depth, 1> for Multiplier {
    const NAME: &'static str = "multiplier";
    const SUMMARY: &'static str = "a map of depth multipliers, which corrects but explains nothing";
    const EQUATION: &'static str = "z m(u, v, z)";
    const SOURCE: &'static str =
        "Teichman, Miller, Thrun 2013, Unsupervised intrinsic calibration of depth sensors via SLAM";
    const PARAMETERS: [Parameter; 1] =
        [Parameter::new("m", "1", 1.0, 1e-2).meaning("Measured over true depth around this node.")];

    #[inline(always)]
    fn map<T: Scalar>(&self, s: DepthState<T>, [m]: [T; 1], _: &Context) -> T {
        s.rho / m
    }
}
