use crate::hook::{Depth, DepthState};
use crate::piece::{Constant, Context, Covariate, On, Options, Parameter, Piece, Scalar, ScanKind};
use crate::technology::Technology;

const BASELINE: Constant =
    Constant::new("baseline_mm", "baseline", "mm", 0.0).searched(Covariate::InverseDepth, ScanKind::Baseline);

/// The projector's own lens bends its pattern, seen as an error of disparity: terms of second order, and a radial one that
/// grows along the baseline (x). A surface at (x, y) and inverse depth ρ lies at (x − bρ, y) of the projector's image plane.
#[derive(Debug, Clone, Copy, Default)]
pub struct ProjectorDistortion {
    /// Distance b of the projector to the right of the camera, mm; 0 neglects the shift.
    pub baseline_mm: f64,
}

impl ProjectorDistortion {
    /// With the constants that are given by name, and defaults for the others.
    pub fn with_options(given: &Options) -> Self {
        Self { baseline_mm: BASELINE.of(given) }
    }
}

impl Piece<Depth, 4> for ProjectorDistortion {
    const NAME: &'static str = "projector_distortion";
    const SUMMARY: &'static str = "the projector's lens distorts its pattern";
    const EQUATION: &'static str = "ρ + pxx x′² + pxy x′ y + pyy y² + pr x′ (x′² + y²), x′ = x − bρ, baseline b";
    const SOURCE: &'static str =
        "Brown's radial distortion of the projector's image, seen as disparity along the baseline";
    const TECHNOLOGIES: &'static [Technology] = &[Technology::StructuredLight];
    const PARAMETERS: [Parameter; 4] = [
        Parameter::new("pxx", "1/mm", 0.0, 1e-4)
            .meaning("Error of disparity that grows with the square along the baseline."),
        Parameter::new("pxy", "1/mm", 0.0, 1e-4).meaning("Error of disparity that grows along both diagonals."),
        Parameter::new("pyy", "1/mm", 0.0, 1e-4)
            .meaning("Error of disparity that grows with the square across the baseline."),
        Parameter::new("pr", "1/mm", 0.0, 1e-4).meaning("Radial distortion of the projector's lens."),
    ];
    const CONSTANTS: &'static [Constant] = &[BASELINE];
    const FORM: On = On::InverseDepth;

    #[inline(always)]
    fn map<T: Scalar>(&self, s: DepthState<T>, [pxx, pxy, pyy, pr]: [T; 4], _: &Context) -> T {
        let x = s.x - s.rho * self.baseline_mm;
        s.rho + pxx * x * x + pxy * x * s.y + pyy * s.y * s.y + pr * x * (x * x + s.y * s.y)
    }
    fn options(&self) -> Vec<(&'static str, f64)> {
        vec![(BASELINE.name, self.baseline_mm)]
    }
}
