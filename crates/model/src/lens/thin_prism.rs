use crate::hook::{Lens, LensState};
use crate::piece::{Context, Parameter, Piece, Scalar};

/// A thin prism: offsets that are even in the radius r of the undistorted ray.
///
/// Domain: alone it is monotone where its Jacobian's determinant 1 + 2 (s1 x + s3 y) + 4 r² (s2 x + s4 y) is positive, so at
/// least up to the radius at which 2 r √(s1² + s3²) + 4 r³ √(s2² + s4²) = 1.
#[derive(Debug, Clone, Copy)]
pub struct ThinPrism;

impl Piece<Lens, 4> for ThinPrism {
    const NAME: &'static str = "thin_prism";
    const SUMMARY: &'static str = "a lens element or filter is tilted";
    const EQUATION: &'static str = "(x + s1 r² + s2 r⁴, y + s3 r² + s4 r⁴), r of the undistorted ray";
    const SOURCE: &'static str = "Weng, Cohen, Herniou 1992, Camera calibration with distortion models";
    const PARAMETERS: [Parameter; 4] = [
        Parameter::new("s1", "1", 0.0, 1e-3).meaning("A lens element or filter is tilted: the image shifts along x."),
        Parameter::new("s2", "1", 0.0, 1e-3).meaning("The same, of fourth order."),
        Parameter::new("s3", "1", 0.0, 1e-3).meaning("A lens element or filter is tilted: the image shifts along y."),
        Parameter::new("s4", "1", 0.0, 1e-3).meaning("The same, of fourth order."),
    ];

    #[inline(always)]
    fn map<T: Scalar>(&self, s: LensState<T>, [s1, s2, s3, s4]: [T; 4], _: &Context) -> [T; 2] {
        let r2 = s.x_true * s.x_true + s.y_true * s.y_true;
        [s.x + (s2 * r2 + s1) * r2, s.y + (s4 * r2 + s3) * r2]
    }
}
