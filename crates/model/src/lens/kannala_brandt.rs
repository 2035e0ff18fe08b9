use crate::hook::{Lens, LensState};
use crate::piece::{Context, Parameter, Piece, Role, Scalar};

/// A fisheye lens: the distorted radius is an odd polynomial of the angle θ to the axis, as in OpenCV's `fisheye` module and
/// Kalibr's `equi`. With all parameters zero it is the equidistant projection.
///
/// Domain: monotone up to the smallest θ at which 1 + 3 k1 θ² + 5 k2 θ⁴ + 7 k3 θ⁶ + 9 k4 θ⁸ = 0, for all rays in front of the
/// camera where there is none.
#[derive(Debug, Clone, Copy)]
pub struct KannalaBrandt;

/// Squared radius below which atan(r) / r is its series: the next term is far below rounding.
const NEAR_AXIS: f64 = 1e-6;

impl Piece<Lens, 4> for KannalaBrandt {
    const NAME: &'static str = "kannala_brandt";
    const TITLE: Option<&'static str> = Some("Lens, Kannala–Brandt");
    const SUMMARY: &'static str = "a fisheye lens, whose image radius is a polynomial of the angle";
    const EQUATION: &'static str = "(x, y) θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸) / r, θ = atan r";
    const SOURCE: &'static str = "Kannala, Brandt 2006, A generic camera model and calibration method for conventional, wide-angle, and fish-eye lenses; \
         OpenCV's fisheye";
    const PARAMETERS: [Parameter; 4] = [
        Parameter::new("k1", "1", 0.0, 0.1).meaning("Deviation from an image radius proportional to the angle."),
        Parameter::new("k2", "1", 0.0, 0.03).meaning("The same, of fifth order."),
        Parameter::new("k3", "1", 0.0, 0.01).meaning("The same, of seventh order."),
        Parameter::new("k4", "1", 0.0, 0.003).meaning("The same, of ninth order."),
    ];
    const ROLE: Role = Role::Model;

    #[inline(always)]
    fn map<T: Scalar>(&self, s: LensState<T>, [k1, k2, k3, k4]: [T; 4], _: &Context) -> [T; 2] {
        let r2 = s.x * s.x + s.y * s.y;
        let angle_over_radius = if r2.re() < NEAR_AXIS {
            ((r2 * -0.2 + 1.0 / 3.0) * -r2) + 1.0
        } else {
            let r = r2.sqrt();
            r.atan() / r
        };
        let t2 = angle_over_radius * angle_over_radius * r2;
        let scale = angle_over_radius * ((((k4 * t2 + k3) * t2 + k2) * t2 + k1) * t2 + 1.0);
        [s.x * scale, s.y * scale]
    }
}
