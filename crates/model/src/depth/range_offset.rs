use crate::hook::{Depth, DepthState};
use crate::{Context, Parameter, Piece, Scalar};

/// A constant along the ray: range + c, so z_m = z + c / √(1 + x² + y²). Signal delay, or a datum that is not the
/// camera's centre.
#[derive(Debug, Clone, Copy)]
pub struct RangeOffset;

impl Piece<Depth, 1> for RangeOffset {
    const NAME: &'static str = "range_offset";
    const SOURCE: &'static str = "Lindner, Kolb 2006, Lateral and depth calibration of PMD distance sensors";
    const PARAMETERS: [Parameter; 1] = [Parameter::new("c", "mm", 0.0, 5.0)];

    #[inline(always)]
    fn map<T: Scalar>(&self, s: DepthState<T>, [c]: [T; 1], _: &Context) -> T {
        let slant = (s.x * s.x + s.y * s.y + 1.0).sqrt();
        s.rho / (c * s.rho / slant + 1.0)
    }
}
