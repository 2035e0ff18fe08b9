use crate::hook::{Lens, LensState};
use crate::piece::{Context, Parameter, Piece, Scalar};

/// A denominator to the radial polynomial of Brown–Conrady, in the radius r of the undistorted ray. It acts before the other
/// lens pieces, so that decentring, which follows from the undistorted ray, is not divided, as in OpenCV.
///
/// Domain: alone it is monotone up to the smallest r at which 1 − k4 r² − 3 k5 r⁴ − 5 k6 r⁶ or the denominator is 0,
/// everywhere where there is none.
#[derive(Debug, Clone, Copy)]
pub struct RationalDistortion;

impl Piece<Lens, 3> for RationalDistortion {
    const NAME: &'static str = "rational_distortion";
    const SUMMARY: &'static str = "the lens distorts more than Brown–Conrady describes";
    const EQUATION: &'static str = "(x, y) / (1 + k4 r² + k5 r⁴ + k6 r⁶), r of the undistorted ray";
    const SOURCE: &'static str = "Claus, Fitzgibbon 2005, A rational function lens distortion model; OpenCV's k4 k5 k6";
    const ACTS_FIRST: bool = true;
    const PARAMETERS: [Parameter; 3] = [
        Parameter::new("k4", "1", 0.0, 0.1).meaning("Radial distortion of wide lenses, in the denominator."),
        Parameter::new("k5", "1", 0.0, 0.1).meaning("The same, of fourth order."),
        Parameter::new("k6", "1", 0.0, 0.1).meaning("The same, of sixth order."),
    ];

    #[inline(always)]
    fn map<T: Scalar>(&self, s: LensState<T>, [k4, k5, k6]: [T; 3], _: &Context) -> [T; 2] {
        let r2 = s.x_true * s.x_true + s.y_true * s.y_true;
        let denominator = ((k6 * r2 + k5) * r2 + k4) * r2 + 1.0;
        [s.x / denominator, s.y / denominator]
    }
}
