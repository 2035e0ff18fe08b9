use crate::hook::{Lens, LensState};
use crate::piece::{Context, Parameter, Piece, Scalar};

/// The sensor is tilted by τx, τy against the lens (Scheimpflug): the image plane is turned and projected again from the
/// centre of the lens, as in OpenCV.
///
/// Domain: a homography, one-to-one where x sin τy − y cos τy sin τx + cos τy cos τx > 0, which is the half of the image
/// plane in front of the tilted sensor.
#[derive(Debug, Clone, Copy)]
pub struct TiltedSensor;

impl Piece<Lens, 2> for TiltedSensor {
    const NAME: &'static str = "tilted_sensor";
    const SUMMARY: &'static str = "the sensor is not square to the lens axis";
    const EQUATION: &'static str = "projection onto a sensor turned by τx and τy (Scheimpflug)";
    const SOURCE: &'static str = "Louhichi et al. 2007, Self-calibration of Scheimpflug cameras; OpenCV's τx τy";
    const PARAMETERS: [Parameter; 2] = [
        Parameter::new("tau_x", "rad", 0.0, 0.01).meaning("Tilt of the sensor about its x axis."),
        Parameter::new("tau_y", "rad", 0.0, 0.01).meaning("Tilt of the sensor about its y axis."),
    ];

    #[inline(always)]
    fn map<T: Scalar>(&self, s: LensState<T>, [tau_x, tau_y]: [T; 2], _: &Context) -> [T; 2] {
        onto_tilted_sensor([s.x, s.y], tau_x, tau_y)
    }
}

/// A point of the image plane, projected from the centre of the lens onto a sensor turned by τx, τy.
#[inline(always)]
pub(super) fn onto_tilted_sensor<T: Scalar>([x, y]: [T; 2], tau_x: T, tau_y: T) -> [T; 2] {
    let ((sx, cx), (sy, cy)) = (tau_x.sin_cos(), tau_y.sin_cos());
    // R = Ry Rx; then the projection onto the tilted plane, [R33 0 −R13; 0 R33 −R23; 0 0 1] R (x, y, 1).
    let turned = [x * cy + y * (sy * sx) - sy * cx, y * cx + sx, x * sy - y * (cy * sx) + cy * cx];
    let (r13, r23, r33) = (-(sy * cx), sx, cy * cx);
    let scale = turned[2].recip();
    [(r33 * turned[0] - r13 * turned[2]) * scale, (r33 * turned[1] - r23 * turned[2]) * scale]
}
