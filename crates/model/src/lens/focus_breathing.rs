use crate::hook::{Lens, LensState};
use crate::{Context, Parameter, Piece, Scalar};

/// The focal length changes with distance: the image is magnified by 1 + b ρ. A constant part is the focal length's.
#[derive(Debug, Clone, Copy)]
pub struct FocusBreathing;

impl Piece<Lens, 1> for FocusBreathing {
    const NAME: &'static str = "focus_breathing";
    const SOURCE: &'static str = "thin lens equation; Brown 1971, Close-range camera calibration";
    const PARAMETERS: [Parameter; 1] = [Parameter::new("b", "mm", 0.0, 1.0)];

    #[inline(always)]
    fn map<T: Scalar>(&self, s: LensState<T>, [b]: [T; 1], _: &Context) -> [T; 2] {
        let magnification = b * s.rho + 1.0;
        [s.x * magnification, s.y * magnification]
    }
}
