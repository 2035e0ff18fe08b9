use crate::hook::{Depth, DepthState};
use crate::{Context, Parameter, Piece, Scalar};

/// Range reported as depth, in part: z_m = z (1 + l (√(1 + x² + y²) − 1)); l = 1 is range, a negative l a depth that was
/// converted twice.
#[derive(Debug, Clone, Copy)]
pub struct RadialRange;

impl Piece<Depth, 1> for RadialRange {
    const NAME: &'static str = "radial_range";
    const SOURCE: &'static str = "geometry of range and depth";
    const PARAMETERS: [Parameter; 1] = [Parameter::new("l", "1", 0.0, 0.1)];

    #[inline(always)]
    fn map<T: Scalar>(&self, s: DepthState<T>, [l]: [T; 1], _: &Context) -> T {
        let excess = (s.x * s.x + s.y * s.y + 1.0).sqrt() - 1.0;
        s.rho / (l * excess + 1.0)
    }
}
