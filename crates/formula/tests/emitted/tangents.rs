use crate::hook::{Lens, LensState};
use crate::piece::{Constant, Context, Options, Parameter, Piece, Scalar};

const K: Constant =
    Constant::new("k", "k", "mm", 1000.0);

/// The place in the image depends on direction x of the ray, direction y of the ray, depth (mm) and inverse depth (1/mm) by a
/// formula.
#[derive(Debug, Clone, Copy)]
pub struct Tangents {
    /// Constant k of the formula, mm.
    pub k: f64,
}

impl Tangents {
    /// With the constants that are given by name, and defaults for the others.
    pub fn with_options(given: &Options) -> Self {
        Self { k: K.of(given) }
    }
}

impl Piece<Lens, 2> for Tangents {
    const NAME: &'static str = "tangents";
    const SUMMARY: &'static str = "the place in the image depends on direction x of the ray, direction y of the ray, depth (mm) and inverse depth (1/mm) by a formula";
    const EQUATION: &'static str = "(x + a min(x, y) z/k, y + b max(x, 0.1) ρ k step(y) + a 2^x)";
    const SOURCE: &'static str = "a formula of the user";
    const PARAMETERS: [Parameter; 2] = [
        Parameter::new("a", "1", 0.0, 0.000877).meaning("Parameter a of the formula a * min(x, y) * z / k; b * max(x, 0.1) * rho * k * step(y) + a * 2^x."),
        Parameter::new("b", "1", 0.0, 0.00351).meaning("Parameter b of the formula a * min(x, y) * z / k; b * max(x, 0.1) * rho * k * step(y) + a * 2^x."),
    ];
    const CONSTANTS: &'static [Constant] = &[K];

    #[inline(always)]
    fn map<T: Scalar>(&self, s: LensState<T>, [a, b]: [T; 2], _: &Context) -> [T; 2] {
        let x = s.x_true;
        let y = s.y_true;
        let z = s.rho.recip();
        let rho = s.rho;
        [s.x + (((a * (if x.re() < y.re() { x } else { y })) * z) / self.k), s.y + (((((b * (if x.re() > 0.1 { x } else { T::from(0.1) })) * rho) * self.k) * f64::from(u8::from(y.re() > 0.0))) + (a * (x * f64::ln(2.0)).exp()))]
    }
    fn options(&self) -> Vec<(&'static str, f64)> {
        vec![(K.name, self.k)]
    }
}
