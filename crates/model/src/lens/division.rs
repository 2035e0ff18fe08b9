use crate::hook::{Lens, LensState};
use crate::piece::{Context, Parameter, Piece, Role, Scalar};

/// The division model: the undistorted radius is r_d / (1 + λ r_d²), with r_d the distorted one; solved for r_d here. One
/// parameter describes wide lenses (λ < 0: barrel).
///
/// Domain: monotone where 4 λ r² < 1, at all radii for λ ≤ 0.
#[derive(Debug, Clone, Copy)]
pub struct Division;

impl Piece<Lens, 1> for Division {
    const NAME: &'static str = "division";
    const TITLE: Option<&'static str> = Some("Lens, division model");
    const SUMMARY: &'static str = "the lens distorts radially, with one parameter";
    const EQUATION: &'static str = "2 (x, y) / (1 + √(1 − 4 λ r²))";
    const SOURCE: &'static str =
        "Fitzgibbon 2001, Simultaneous linear estimation of multiple view geometry and lens distortion";
    const PARAMETERS: [Parameter; 1] =
        [Parameter::new("lambda", "1", 0.0, 0.1).meaning("Radial distortion; barrel where it is negative.")];
    const ROLE: Role = Role::Model;

    #[inline(always)]
    fn map<T: Scalar>(&self, s: LensState<T>, [lambda]: [T; 1], _: &Context) -> [T; 2] {
        let r2 = s.x * s.x + s.y * s.y;
        let root = (lambda * r2 * -4.0 + 1.0).sqrt();
        let scale = (root + 1.0).recip() * 2.0;
        [s.x * scale, s.y * scale]
    }
}
