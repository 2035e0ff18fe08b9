use super::tilted_sensor::onto_tilted_sensor;
use crate::hook::{Lens, LensState};
use crate::piece::{Context, Parameter, Piece, Role, Scalar};

/// OpenCV's whole lens model in its order of coefficients: radial distortion by a rational function, decentring, thin prism,
/// tilted sensor. 8, 12 or 14 coefficients are free; the rest are held at zero. The decentring is not divided by the rational
/// function's denominator.
///
/// Domain: without decentring, prism and tilt it is monotone up to the smallest r at which d(r N/D)/dr or the denominator D is 0;
/// a [`Camera`](crate::Camera) finds it for the whole model.
#[derive(Debug, Clone, Copy)]
pub struct OpencvLens;

impl Piece<Lens, 14> for OpencvLens {
    const NAME: &'static str = "opencv_lens";
    const TITLE: Option<&'static str> = Some("Lens, OpenCV's rational, thin-prism and tilted model");
    const SUMMARY: &'static str = "the lens distorts as OpenCV's model of 8, 12 or 14 coefficients has it";
    const EQUATION: &'static str = "tilt(τx, τy) of (x, y) (1 + k1 r² + k2 r⁴ + k3 r⁶) / (1 + k4 r² + k5 r⁴ + k6 r⁶) + \
                                    (2 p1 x y + p2 (r² + 2 x²) + s1 r² + s2 r⁴, p1 (r² + 2 y²) + 2 p2 x y + s3 r² + s4 r⁴)";
    const SOURCE: &'static str =
        "OpenCV's projectPoints; Claus, Fitzgibbon 2005; Weng, Cohen, Herniou 1992; Louhichi et al. 2007";
    const PARAMETERS: [Parameter; 14] = [
        Parameter::new("k1", "1", 0.0, 0.1).meaning("Radial distortion, in the numerator."),
        Parameter::new("k2", "1", 0.0, 0.1).meaning("The same, of fourth order."),
        Parameter::new("p1", "1", 0.0, 1e-3).meaning("Decentring along y: lens elements that do not share one axis."),
        Parameter::new("p2", "1", 0.0, 1e-3).meaning("Decentring along x: lens elements that do not share one axis."),
        Parameter::new("k3", "1", 0.0, 0.1).meaning("Radial distortion of sixth order, in the numerator."),
        Parameter::new("k4", "1", 0.0, 0.1).meaning("Radial distortion, in the denominator."),
        Parameter::new("k5", "1", 0.0, 0.1).meaning("The same, of fourth order."),
        Parameter::new("k6", "1", 0.0, 0.1).meaning("The same, of sixth order."),
        Parameter::new("s1", "1", 0.0, 1e-3).meaning("Thin prism: the image shifts along x."),
        Parameter::new("s2", "1", 0.0, 1e-3).meaning("The same, of fourth order."),
        Parameter::new("s3", "1", 0.0, 1e-3).meaning("Thin prism: the image shifts along y."),
        Parameter::new("s4", "1", 0.0, 1e-3).meaning("The same, of fourth order."),
        Parameter::new("tau_x", "rad", 0.0, 0.01).meaning("Tilt of the sensor about its x axis."),
        Parameter::new("tau_y", "rad", 0.0, 0.01).meaning("Tilt of the sensor about its y axis."),
    ];
    const ROLE: Role = Role::Model;

    #[inline(always)]
    fn map<T: Scalar>(&self, s: LensState<T>, theta: [T; 14], _: &Context) -> [T; 2] {
        let [k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, tau_x, tau_y] = theta;
        let (x, y) = (s.x, s.y);
        let (xx, yy, xy) = (x * x, y * y, x * y * 2.0);
        let r2 = xx + yy;
        let series = |a: T, b: T, c: T| ((c * r2 + b) * r2 + a) * r2 + 1.0;
        let radial = series(k1, k2, k3) / series(k4, k5, k6);
        let xd = x * radial + p1 * xy + p2 * (r2 + xx * 2.0) + (s2 * r2 + s1) * r2;
        let yd = y * radial + p1 * (r2 + yy * 2.0) + p2 * xy + (s4 * r2 + s3) * r2;
        onto_tilted_sensor([xd, yd], tau_x, tau_y)
    }
}
