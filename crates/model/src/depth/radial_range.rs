use crate::hook::{Depth, DepthState};
use crate::piece::{Context, On, Parameter, Piece, Scalar};

/// Range along the ray is reported as depth, in part: l = 1 is range, a negative l a depth that was converted twice.
#[derive(Debug, Clone, Copy)]
pub struct RadialRange;

impl Piece<Depth, 1> for RadialRange {
    const NAME: &'static str = "radial_range";
    const SUMMARY: &'static str = "range along the ray is reported as depth, in part";
    const EQUATION: &'static str = "z (1 + l (√(1 + x² + y²) − 1))";
    const SOURCE: &'static str = "geometry of range and depth";
    const PARAMETERS: [Parameter; 1] =
        [Parameter::new("l", "1", 0.0, 0.1).meaning("Share of the range along the ray in what is reported as depth.")];
    const FORM: On = On::Factor;

    #[inline(always)]
    fn map<T: Scalar>(&self, s: DepthState<T>, [l]: [T; 1], _: &Context) -> T {
        let excess = (s.x * s.x + s.y * s.y + 1.0).sqrt() - 1.0;
        s.rho / (l * excess + 1.0)
    }
}
