use crate::hook::{Lens, LensState};
use crate::piece::{Context, Parameter, Piece, Scalar};

/// The focal length changes with distance: the image is magnified by 1 + b ρ. The pinhole takes up a constant part.
///
/// Domain: monotone where 1 + b ρ > 0, at all radii: at all depths for b > 0, beyond a depth of −b mm for b < 0.
#[derive(Debug, Clone, Copy)]
pub struct FocusBreathing;

impl Piece<Lens, 1> for FocusBreathing {
    const NAME: &'static str = "focus_breathing";
    const SUMMARY: &'static str = "the focal length changes with distance";
    const EQUATION: &'static str = "(x, y) (1 + b ρ)";
    const SOURCE: &'static str = "thin lens equation; Brown 1971, Close-range camera calibration";
    const PARAMETERS: [Parameter; 1] =
        [Parameter::new("b", "mm", 0.0, 1.0).meaning("Growth of the focal length with inverse depth.")];

    #[inline(always)]
    fn map<T: Scalar>(&self, s: LensState<T>, [b]: [T; 1], _: &Context) -> [T; 2] {
        let magnification = b * s.rho + 1.0;
        [s.x * magnification, s.y * magnification]
    }
}
