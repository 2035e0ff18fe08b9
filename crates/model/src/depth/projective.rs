use crate::hook::{Depth, DepthState};
use crate::piece::{Context, Parameter, Piece, Role, Scalar};

/// The homography D, identity but for its last row. It is affine in inverse depth, and the only model that leaves planes
/// planar and pixels in place.
#[derive(Debug, Clone, Copy)]
pub struct Projective;

impl Piece<Depth, 4> for Projective {
    const NAME: &'static str = "projective";
    const TITLE: Option<&'static str> = Some("Projective depth distortion D");
    const SUMMARY: &'static str = "measured inverse depth is affine in ray and inverse depth";
    const EQUATION: &'static str = "dx x + dy y + dz + dw ρ";
    const SOURCE: &'static str = "Sjöholm 2017, Calibration using a general homogeneous depth camera model, eq. 4.4";
    const CONFOUNDED: Option<&'static str> = Some(
        "A board cannot tell apart what D takes up: dw is baseline, focal scale and the board's print scale together (a print \
         that is 0.1 % too large makes every depth 0.1 % too large), dz is any constant offset of the disparity, dy any roll \
         of the projector. The standard deviations say how well the frames determine the number, not its cause.",
    );
    const PARAMETERS: [Parameter; 4] = [
        Parameter::new("dx", "1/mm", 0.0, 1e-4)
            .meaning("Depth tilts from left to right: the projector is turned against the camera."),
        Parameter::new("dy", "1/mm", 0.0, 1e-4).meaning("Depth tilts from top to bottom: a rolled projector."),
        Parameter::new("dz", "1/mm", 0.0, 1e-4).meaning("A constant offset of the disparity."),
        Parameter::new("dw", "1", 1.0, 1e-2)
            .meaning("Scale of the depth: baseline, focal scale and the board's print scale together."),
    ];
    const ROLE: Role = Role::Model;

    #[inline(always)]
    fn map<T: Scalar>(&self, s: DepthState<T>, [dx, dy, dz, dw]: [T; 4], _: &Context) -> T {
        dx * s.x + dy * s.y + dz + dw * s.rho
    }
}
