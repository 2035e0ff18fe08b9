use crate::hook::{Depth, DepthState};
use crate::piece::{Constant, Context, Covariate, Options, Parameter, Piece, Scalar, ScanKind};
use crate::technology::Technology;

const PERIOD: Constant = Constant::new("period_mm", "period", "mm", 300.0).searched(Covariate::Depth, ScanKind::Period);

/// The wiggling of time-of-flight cameras: first and second harmonic of a wave over depth.
#[derive(Debug, Clone, Copy)]
pub struct CyclicDepth {
    /// Period p in depth, mm.
    pub period_mm: f64,
}

impl CyclicDepth {
    /// With the constants that are given by name, and defaults for the others.
    pub fn with_options(given: &Options) -> Self {
        Self { period_mm: PERIOD.of(given) }
    }
}

impl Piece<Depth, 4> for CyclicDepth {
    const NAME: &'static str = "cyclic_depth";
    const SUMMARY: &'static str = "depth waves over distance (time-of-flight wiggling)";
    const EQUATION: &'static str = "z + a1 sin φ + b1 cos φ + a2 sin 2φ + b2 cos 2φ, φ = 2πz/p";
    const SOURCE: &'static str = "Lindner, Kolb 2006; Kahlmann, Remondino, Ingensand 2006";
    const TECHNOLOGIES: &'static [Technology] = &[Technology::TimeOfFlight];
    const PARAMETERS: [Parameter; 4] = [
        Parameter::new("a1", "mm", 0.0, 2.0).meaning("Depth wave over distance, sine part."),
        Parameter::new("b1", "mm", 0.0, 2.0).meaning("Depth wave over distance, cosine part."),
        Parameter::new("a2", "mm", 0.0, 1.0).meaning("Depth wave of half the period, sine part."),
        Parameter::new("b2", "mm", 0.0, 1.0).meaning("Depth wave of half the period, cosine part."),
    ];
    const CONSTANTS: &'static [Constant] = &[PERIOD];

    #[inline(always)]
    fn map<T: Scalar>(&self, s: DepthState<T>, [a1, b1, a2, b2]: [T; 4], _: &Context) -> T {
        let phase = s.rho.recip() * (std::f64::consts::TAU / self.period_mm);
        let ((s1, c1), (s2, c2)) = (phase.sin_cos(), (phase * 2.0).sin_cos());
        s.rho / ((a1 * s1 + b1 * c1 + a2 * s2 + b2 * c2) * s.rho + 1.0)
    }
    fn options(&self) -> Vec<(&'static str, f64)> {
        vec![(PERIOD.name, self.period_mm)]
    }
}
