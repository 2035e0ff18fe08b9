use crate::hook::{Lens, LensState};
use crate::{Context, Parameter, Piece, Scalar};

/// Thin prism: x' += s1 r² + s2 r⁴, y' += s3 r² + s4 r⁴, r of the undistorted ray.
#[derive(Debug, Clone, Copy)]
pub struct ThinPrism;

impl Piece<Lens, 4> for ThinPrism {
    const NAME: &'static str = "thin_prism";
    const SOURCE: &'static str = "Weng, Cohen, Herniou 1992, Camera calibration with distortion models";
    const PARAMETERS: [Parameter; 4] = [
        Parameter::new("s1", "1", 0.0, 1e-3),
        Parameter::new("s2", "1", 0.0, 1e-3),
        Parameter::new("s3", "1", 0.0, 1e-3),
        Parameter::new("s4", "1", 0.0, 1e-3),
    ];

    #[inline(always)]
    fn map<T: Scalar>(&self, s: LensState<T>, [s1, s2, s3, s4]: [T; 4], _: &Context) -> [T; 2] {
        let r2 = s.x_true * s.x_true + s.y_true * s.y_true;
        [s.x + (s2 * r2 + s1) * r2, s.y + (s4 * r2 + s3) * r2]
    }
}
