use crate::hook::{Depth, DepthState};
use crate::{Context, Parameter, Piece, Role, Scalar};

/// The homography D, identity but for its last row: ρ_m = dx x + dy y + dz + dw ρ.
///
/// Affine in inverse depth, and the only model that leaves planes planar and pixels in place. dw takes up baseline,
/// focal scale and the board's print scale, dz a disparity offset, dy a rolled projector: a board cannot tell those
/// apart.
#[derive(Debug, Clone, Copy)]
pub struct Projective;

impl Piece<Depth, 4> for Projective {
    const NAME: &'static str = "projective";
    const SOURCE: &'static str = "Sjöholm 2017, Calibration using a general homogeneous depth camera model, eq. 4.4";
    const PARAMETERS: [Parameter; 4] = [
        Parameter::new("dx", "1/mm", 0.0, 1e-4),
        Parameter::new("dy", "1/mm", 0.0, 1e-4),
        Parameter::new("dz", "1/mm", 0.0, 1e-4),
        Parameter::new("dw", "1", 1.0, 1e-2),
    ];
    const ROLE: Role = Role::Model;

    #[inline(always)]
    fn map<T: Scalar>(&self, s: DepthState<T>, [dx, dy, dz, dw]: [T; 4], _: &Context) -> T {
        dx * s.x + dy * s.y + dz + dw * s.rho
    }
}
