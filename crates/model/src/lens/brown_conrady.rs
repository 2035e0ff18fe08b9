use crate::hook::{Lens, LensState};
use crate::{Context, Parameter, Piece, Role, Scalar};

/// Radial and tangential distortion in OpenCV's order k1 k2 p1 p2 k3:
/// x' = x (1 + k1 r² + k2 r⁴ + k3 r⁶) + 2 p1 x y + p2 (r² + 2 x²),
/// y' = y (1 + k1 r² + k2 r⁴ + k3 r⁶) + p1 (r² + 2 y²) + 2 p2 x y.
#[derive(Debug, Clone, Copy)]
pub struct BrownConrady;

impl Piece<Lens, 5> for BrownConrady {
    const NAME: &'static str = "brown_conrady";
    const SOURCE: &'static str = "Brown 1966, Decentering distortion of lenses; Conrady 1919";
    const PARAMETERS: [Parameter; 5] = [
        Parameter::new("k1", "1", 0.0, 0.1),
        Parameter::new("k2", "1", 0.0, 0.1),
        Parameter::new("p1", "1", 0.0, 1e-3),
        Parameter::new("p2", "1", 0.0, 1e-3),
        Parameter::new("k3", "1", 0.0, 0.1),
    ];
    const ROLE: Role = Role::Model;

    #[inline(always)]
    fn map<T: Scalar>(&self, s: LensState<T>, [k1, k2, p1, p2, k3]: [T; 5], _: &Context) -> [T; 2] {
        let (x, y) = (s.x, s.y);
        let (xx, yy, xy) = (x * x, y * y, x * y * 2.0);
        let r2 = xx + yy;
        let radial = ((k3 * r2 + k2) * r2 + k1) * r2 + 1.0;
        [x * radial + p1 * xy + p2 * (r2 + xx * 2.0), y * radial + p1 * (r2 + yy * 2.0) + p2 * xy]
    }
}
