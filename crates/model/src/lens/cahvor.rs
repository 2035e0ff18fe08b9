use crate::hook::{Lens, LensState};
use crate::piece::{Context, Parameter, Piece, Role, Scalar};

/// CAHVOR's radial distortion about an optical axis O of its own, which mrcal gives by two angles: the ray p = (x, y, 1) becomes
/// p + μ (p − (p·O) O), and is projected.
///
/// Domain: with O along z it is monotone up to the smallest r at which 1 + r0 + 3 r1 r² + 5 r2 r⁴ = 0.
#[derive(Debug, Clone, Copy)]
pub struct Cahvor;

impl Piece<Lens, 5> for Cahvor {
    const NAME: &'static str = "cahvor";
    const TITLE: Option<&'static str> = Some("Lens, CAHVOR");
    const SUMMARY: &'static str = "the lens distorts radially about an axis that is not square to the sensor";
    const EQUATION: &'static str = "projection of p (1 + μ) − μ ω O, p = (x, y, 1), O = (sin α cos β, sin β, cos α cos β), ω = p·O, \
                                    τ = p·p/ω² − 1, μ = r0 + r1 τ + r2 τ²";
    const SOURCE: &'static str =
        "Gennery 2006, Generalized camera calibration including fish-eye lenses; mrcal's LENSMODEL_CAHVOR";
    const PARAMETERS: [Parameter; 5] = [
        Parameter::new("alpha", "rad", 0.0, 0.01).meaning("Tilt of the optical axis towards x."),
        Parameter::new("beta", "rad", 0.0, 0.01).meaning("Tilt of the optical axis towards y."),
        Parameter::new("r0", "1", 0.0, 0.01).meaning("Magnification across the optical axis."),
        Parameter::new("r1", "1", 0.0, 0.1).meaning("Radial distortion."),
        Parameter::new("r2", "1", 0.0, 0.1).meaning("The same, of fourth order."),
    ];
    const ROLE: Role = Role::Model;

    #[inline(always)]
    fn map<T: Scalar>(&self, s: LensState<T>, [alpha, beta, r0, r1, r2]: [T; 5], _: &Context) -> [T; 2] {
        let ((sa, ca), (sb, cb)) = (alpha.sin_cos(), beta.sin_cos());
        let o = [cb * sa, sb, cb * ca];
        let omega = s.x * o[0] + s.y * o[1] + o[2];
        let tau = (s.x * s.x + s.y * s.y + 1.0) / (omega * omega) - 1.0;
        let mu = (r2 * tau + r1) * tau + r0;
        let along = mu * omega;
        let z = (mu + 1.0 - along * o[2]).recip();
        [(s.x * (mu + 1.0) - along * o[0]) * z, (s.y * (mu + 1.0) - along * o[1]) * z]
    }
}
