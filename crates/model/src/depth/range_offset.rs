use crate::hook::{Depth, DepthState};
use crate::piece::{Context, Parameter, Piece, Scalar};

/// A constant along the ray, range + c: signal delay, or a datum that is not the centre of the camera.
#[derive(Debug, Clone, Copy)]
pub struct RangeOffset;

impl Piece<Depth, 1> for RangeOffset {
    const NAME: &'static str = "range_offset";
    const SUMMARY: &'static str = "a constant is added along every ray (signal delay, mounting datum)";
    const EQUATION: &'static str = "z + c / √(1 + x² + y²)";
    const SOURCE: &'static str = "Lindner, Kolb 2006, Lateral and depth calibration of PMD distance sensors";
    const PARAMETERS: [Parameter; 1] =
        [Parameter::new("c", "mm", 0.0, 5.0)
            .meaning("A constant added along the ray: signal delay or mounting datum.")];

    #[inline(always)]
    fn map<T: Scalar>(&self, s: DepthState<T>, [c]: [T; 1], _: &Context) -> T {
        let slant = (s.x * s.x + s.y * s.y + 1.0).sqrt();
        s.rho / (c * s.rho / slant + 1.0)
    }
}
