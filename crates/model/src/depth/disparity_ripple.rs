use crate::hook::{Depth, DepthState};
use crate::piece::{Constant, Context, Covariate, On, Options, Parameter, Piece, Scalar, ScanKind};
use crate::technology::Technology;

const PERIOD: Constant =
    Constant::new("period_per_mm", "period", "1/mm", 4e-5).searched(Covariate::InverseDepth, ScanKind::Period);

/// Sub-pixel locking: the measured inverse depth ripples with the disparity.
#[derive(Debug, Clone, Copy)]
pub struct DisparityRipple {
    /// Period p in inverse depth, 1/mm: one pixel of disparity.
    pub period_per_mm: f64,
}

impl DisparityRipple {
    /// With the constants that are given by name, and defaults for the others.
    pub fn with_options(given: &Options) -> Self {
        Self { period_per_mm: PERIOD.of(given) }
    }
}

impl Piece<Depth, 2> for DisparityRipple {
    const NAME: &'static str = "disparity_ripple";
    const SUMMARY: &'static str = "depth waves with every step of disparity (sub-pixel locking)";
    const EQUATION: &'static str = "ρ + a sin(2πρ/p) + b cos(2πρ/p)";
    const SOURCE: &'static str = "Shimizu, Okutomi 2001, Precise sub-pixel estimation on area-based matching";
    const TECHNOLOGIES: &'static [Technology] = Technology::OF_DISPARITY;
    const PARAMETERS: [Parameter; 2] = [
        Parameter::new("a", "1/mm", 0.0, 1e-6).meaning("Wave that repeats with every step of disparity, sine part."),
        Parameter::new("b", "1/mm", 0.0, 1e-6).meaning("Wave that repeats with every step of disparity, cosine part."),
    ];
    const CONSTANTS: &'static [Constant] = &[PERIOD];
    const FORM: On = On::InverseDepth;

    #[inline(always)]
    fn map<T: Scalar>(&self, s: DepthState<T>, [a, b]: [T; 2], _: &Context) -> T {
        let (sin, cos) = (s.rho * (std::f64::consts::TAU / self.period_per_mm)).sin_cos();
        s.rho + a * sin + b * cos
    }
    fn options(&self) -> Vec<(&'static str, f64)> {
        vec![(PERIOD.name, self.period_per_mm)]
    }
}
