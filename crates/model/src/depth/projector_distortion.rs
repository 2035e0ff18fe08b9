use crate::hook::{Depth, DepthState};
use crate::{Context, Parameter, Piece, Scalar};

/// The projector's own lens: terms of second order in (x, y) in the measured inverse depth, and a radial one that grows
/// along the baseline (x).
#[derive(Debug, Clone, Copy)]
pub struct ProjectorDistortion;

impl Piece<Depth, 4> for ProjectorDistortion {
    const NAME: &'static str = "projector_distortion";
    const SOURCE: &'static str =
        "Brown's radial distortion of the projector's image, seen as disparity along the baseline";
    const PARAMETERS: [Parameter; 4] = [
        Parameter::new("pxx", "1/mm", 0.0, 1e-4),
        Parameter::new("pxy", "1/mm", 0.0, 1e-4),
        Parameter::new("pyy", "1/mm", 0.0, 1e-4),
        Parameter::new("pr", "1/mm", 0.0, 1e-4),
    ];

    #[inline(always)]
    fn map<T: Scalar>(&self, s: DepthState<T>, [pxx, pxy, pyy, pr]: [T; 4], _: &Context) -> T {
        s.rho + pxx * s.x * s.x + pxy * s.x * s.y + pyy * s.y * s.y + pr * s.x * (s.x * s.x + s.y * s.y)
    }
}
