use crate::hook::{Depth, DepthState};
use crate::register::Options;
use crate::{Context, Covariate, Parameter, Piece, Scalar, Scan, ScanKind};

/// Sub-pixel locking: the measured inverse depth ripples with the disparity, ρ + a sin(2πρ/p) + b cos(2πρ/p).
#[derive(Debug, Clone, Copy)]
pub struct DisparityRipple {
    /// Period p in inverse depth, 1/mm: one pixel of disparity.
    pub period_per_mm: f64,
}

impl DisparityRipple {
    /// With the constants that are given by name, and defaults for the others.
    pub fn with_options(options: &Options) -> Self {
        let option = |name: &str, default: f64| options.get(name).copied().unwrap_or(default);
        Self { period_per_mm: option("period_per_mm", 4e-5) }
    }
}

impl Piece<Depth, 2> for DisparityRipple {
    const NAME: &'static str = "disparity_ripple";
    const SOURCE: &'static str = "Shimizu, Okutomi 2001, Precise sub-pixel estimation on area-based matching";
    const PARAMETERS: [Parameter; 2] = [Parameter::new("a", "1/mm", 0.0, 1e-6), Parameter::new("b", "1/mm", 0.0, 1e-6)];
    const SCAN: Option<Scan> =
        Some(Scan { constant: "period_per_mm", covariate: Covariate::InverseDepth, kind: ScanKind::Period });

    #[inline(always)]
    fn map<T: Scalar>(&self, s: DepthState<T>, [a, b]: [T; 2], _: &Context) -> T {
        let (sin, cos) = (s.rho * (std::f64::consts::TAU / self.period_per_mm)).sin_cos();
        s.rho + a * sin + b * cos
    }
    fn options(&self) -> Vec<(&'static str, f64)> {
        vec![("period_per_mm", self.period_per_mm)]
    }
}
