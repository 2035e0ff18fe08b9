//! The effect `amplitude_bias` of effects.toml in Rust.

use crate::hook::{Depth, DepthState};
use crate::piece::{Constant, Context, Covariate, Options, Parameter, Piece, Scalar};

const AMPLITUDE0: Constant = Constant::new("amplitude0", "amplitude0", "1", 1000.0);
const K: Constant = Constant::new("k", "k", "mm", 1000.0);

/// Depth depends on direction x of the ray, distance from the camera (mm), infrared amplitude (steps) and infrared amplitude
/// around the pixel (steps) by a formula.
#[derive(Debug, Clone, Copy)]
pub struct AmplitudeBias {
    /// Constant amplitude0 of the formula.
    pub amplitude0: f64,
    /// Constant k of the formula, mm.
    pub k: f64,
}

impl AmplitudeBias {
    /// With the constants that are given by name, and defaults for the others.
    pub fn with_options(given: &Options) -> Self {
        Self { amplitude0: AMPLITUDE0.of(given), k: K.of(given) }
    }
}

impl Piece<Depth, 2> for AmplitudeBias {
    const NAME: &'static str = "amplitude_bias";
    const SUMMARY: &'static str = "depth depends on direction x of the ray, distance from the camera (mm), infrared amplitude (steps) and infrared amplitude around the pixel (steps) by a formula";
    const EQUATION: &'static str = "z + A √(amplitude₀/A) + b hinge(ln(Ā/amplitude₀)) |x|^1.5 ℓ/k";
    const SOURCE: &'static str = "a formula of the user";
    const PARAMETERS: [Parameter; 2] = [
        Parameter::new("A", "mm", 0.0, 0.474).meaning("Parameter A of the formula A * sqrt(amplitude0 / amplitude) + b * hinge(log(surroundings / amplitude0)) * abs(x)^1.5 * range / k."),
        Parameter::new("b", "mm", 0.0, 4.46).meaning("Parameter b of the formula A * sqrt(amplitude0 / amplitude) + b * hinge(log(surroundings / amplitude0)) * abs(x)^1.5 * range / k."),
    ];
    const CONSTANTS: &'static [Constant] = &[AMPLITUDE0, K];
    const NEEDS: &'static [Covariate] = &[Covariate::Amplitude, Covariate::Surroundings];

    #[inline(always)]
    fn map<T: Scalar>(&self, s: DepthState<T>, [p_a, b]: [T; 2], c: &Context) -> T {
        if !(c.amplitude > 0.0) {
            return s.rho;
        }
        if !(c.surround > 0.0) {
            return s.rho;
        }
        let x = s.x;
        let range = (s.x * s.x + s.y * s.y + 1.0).sqrt() / s.rho;
        let amplitude = c.amplitude;
        let surroundings = c.surround;
        let e = (p_a * f64::sqrt(self.amplitude0 / amplitude))
            + ((((b
                * (f64::ln(surroundings / self.amplitude0)
                    * f64::from(u8::from(f64::ln(surroundings / self.amplitude0) > 0.0))))
                * (x * x.re().signum()).powf(1.5))
                * range)
                / self.k);
        s.rho / (e * s.rho + 1.0)
    }
    fn options(&self) -> Vec<(&'static str, f64)> {
        vec![(AMPLITUDE0.name, self.amplitude0), (K.name, self.k)]
    }
}
