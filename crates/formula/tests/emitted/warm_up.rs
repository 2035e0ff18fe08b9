use crate::hook::{Depth, DepthState};
use crate::piece::{Constant, Context, Covariate, On, Options, Parameter, Piece, Scalar, ScanKind};

const T0: Constant =
    Constant::new("t0", "t0", "°C", 25.0);
const TAU: Constant =
    Constant::new("tau", "tau", "s", 600.0).searched(Covariate::Time, ScanKind::TimeConstant);

/// Depth depends on distance r from the optical axis, time (s) and temperature (°C) by a formula.
#[derive(Debug, Clone, Copy)]
pub struct WarmUp {
    /// Constant t0 of the formula, °C.
    pub t0: f64,
    /// Constant tau of the formula, s.
    pub tau: f64,
}

impl WarmUp {
    /// With the constants that are given by name, and defaults for the others.
    pub fn with_options(given: &Options) -> Self {
        Self { t0: T0.of(given), tau: TAU.of(given) }
    }
}

impl Piece<Depth, 2> for WarmUp {
    const NAME: &'static str = "warm_up";
    const SUMMARY: &'static str = "depth depends on distance r from the optical axis, time (s) and temperature (°C) by a formula";
    const EQUATION: &'static str = "z (1 + a (1 − exp(−t/τ)) + b (T − t₀) r)";
    const SOURCE: &'static str = "a formula of the user";
    const PARAMETERS: [Parameter; 2] = [
        Parameter::new("a", "1", 0.0, 0.00133).meaning("Parameter a of the formula a * (1 - exp(-timestamp_s / tau)) + b * (temperature_c - t0) * r."),
        Parameter::new("b", "1/°C", 0.0, 0.000224).meaning("The scale changes with temperature towards the border."),
    ];
    const CONSTANTS: &'static [Constant] = &[T0, TAU];
    const NEEDS: &'static [Covariate] = &[Covariate::Time, Covariate::Temperature];
    const FORM: On = On::Factor;

    #[inline(always)]
    fn map<T: Scalar>(&self, s: DepthState<T>, [a, b]: [T; 2], c: &Context) -> T {
        if c.temperature_c.is_nan() {
            return s.rho;
        }
        let r = { let square = s.x * s.x + s.y * s.y; if square.re() > 0.0 { square.sqrt() } else { square } };
        let timestamp_s = c.time_s;
        let temperature_c = c.temperature_c;
        let e = (a * (1.0 - f64::exp((-timestamp_s) / self.tau))) + ((b * (temperature_c - self.t0)) * r);
        s.rho / (e + 1.0)
    }
    fn options(&self) -> Vec<(&'static str, f64)> {
        vec![(T0.name, self.t0), (TAU.name, self.tau)]
    }
}
