use crate::hook::{Lens, LensState};
use crate::piece::{Context, Parameter, Piece, Role, Scalar};

/// Radial and tangential distortion in OpenCV's order k1 k2 p1 p2 k3:
/// x' = x (1 + k1 r² + k2 r⁴ + k3 r⁶) + 2 p1 x y + p2 (r² + 2 x²),
/// y' = y (1 + k1 r² + k2 r⁴ + k3 r⁶) + p1 (r² + 2 y²) + 2 p2 x y.
///
/// Domain: without p1 and p2 it is monotone up to the smallest r at which 1 + 3 k1 r² + 5 k2 r⁴ + 7 k3 r⁶ = 0, everywhere
/// where there is none. Beyond it the image folds back.
#[derive(Debug, Clone, Copy)]
pub struct BrownConrady;

impl Piece<Lens, 5> for BrownConrady {
    const NAME: &'static str = "brown_conrady";
    const TITLE: Option<&'static str> = Some("Lens, Brown–Conrady");
    const SUMMARY: &'static str = "the lens distorts radially and tangentially";
    const EQUATION: &'static str =
        "(x, y) (1 + k1 r² + k2 r⁴ + k3 r⁶) + (2 p1 x y + p2 (r² + 2 x²), p1 (r² + 2 y²) + 2 p2 x y)";
    const SOURCE: &'static str = "Brown 1966, Decentering distortion of lenses; Conrady 1919";
    const PARAMETERS: [Parameter; 5] = [
        Parameter::new("k1", "1", 0.0, 0.1)
            .meaning("Radial distortion: straight lines bend like a barrel or a pincushion."),
        Parameter::new("k2", "1", 0.0, 0.1).meaning("Radial distortion of fourth order."),
        Parameter::new("p1", "1", 0.0, 1e-3).meaning("Decentring along y: lens elements that do not share one axis."),
        Parameter::new("p2", "1", 0.0, 1e-3).meaning("Decentring along x: lens elements that do not share one axis."),
        Parameter::new("k3", "1", 0.0, 0.1).meaning("Radial distortion of sixth order."),
    ];
    const ROLE: Role = Role::Model;

    #[inline(always)]
    fn map<T: Scalar>(&self, s: LensState<T>, [k1, k2, p1, p2, k3]: [T; 5], _: &Context) -> [T; 2] {
        let (x, y) = (s.x_true, s.y_true);
        let (xx, yy, xy) = (x * x, y * y, x * y * 2.0);
        let r2 = xx + yy;
        let radial = ((k3 * r2 + k2) * r2 + k1) * r2 + 1.0;
        // A denominator that acted before is in s.x and s.y; it divides the radial part alone.
        [s.x * radial + p1 * xy + p2 * (r2 + xx * 2.0), s.y * radial + p1 * (r2 + yy * 2.0) + p2 * xy]
    }
}
