use crate::hook::{Lens, LensState};
use crate::{Context, Parameter, Piece, Scalar};

/// A denominator to the radial polynomial: divides by 1 + k4 r² + k5 r⁴ + k6 r⁶, r of the undistorted ray.
#[derive(Debug, Clone, Copy)]
pub struct RationalDistortion;

impl Piece<Lens, 3> for RationalDistortion {
    const NAME: &'static str = "rational_distortion";
    const SOURCE: &'static str = "Claus, Fitzgibbon 2005, A rational function lens distortion model; OpenCV's k4 k5 k6";
    const PARAMETERS: [Parameter; 3] =
        [Parameter::new("k4", "1", 0.0, 0.1), Parameter::new("k5", "1", 0.0, 0.1), Parameter::new("k6", "1", 0.0, 0.1)];

    #[inline(always)]
    fn map<T: Scalar>(&self, s: LensState<T>, [k4, k5, k6]: [T; 3], _: &Context) -> [T; 2] {
        let r2 = s.x_true * s.x_true + s.y_true * s.y_true;
        let denominator = ((k6 * r2 + k5) * r2 + k4) * r2 + 1.0;
        [s.x / denominator, s.y / denominator]
    }
}
