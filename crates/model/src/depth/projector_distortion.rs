use crate::hook::{Depth, DepthState};
use crate::register::Options;
use crate::{Context, Covariate, Parameter, Piece, Scalar, Scan, ScanKind};

/// The projector's own lens: terms of second order in (x, y) in the measured inverse depth, and a radial one that grows
/// along the baseline (x). The pattern is bent where the projector throws it: a surface at (x, y) and inverse depth ρ lies
/// at (x − bρ, y) of the projector's image plane, b being the baseline.
#[derive(Debug, Clone, Copy, Default)]
pub struct ProjectorDistortion {
    /// How far to the right of the camera the projector is, mm; 0 where the shift is neglected.
    pub baseline_mm: f64,
}

impl ProjectorDistortion {
    /// With the constants that are given by name, and defaults for the others.
    pub fn with_options(options: &Options) -> Self {
        Self { baseline_mm: options.get("baseline_mm").copied().unwrap_or(0.0) }
    }
}

impl Piece<Depth, 4> for ProjectorDistortion {
    const NAME: &'static str = "projector_distortion";
    const SOURCE: &'static str =
        "Brown's radial distortion of the projector's image, seen as disparity along the baseline";
    const PARAMETERS: [Parameter; 4] = [
        Parameter::new("pxx", "1/mm", 0.0, 1e-4),
        Parameter::new("pxy", "1/mm", 0.0, 1e-4),
        Parameter::new("pyy", "1/mm", 0.0, 1e-4),
        Parameter::new("pr", "1/mm", 0.0, 1e-4),
    ];
    const SCAN: Option<Scan> =
        Some(Scan { constant: "baseline_mm", covariate: Covariate::InverseDepth, kind: ScanKind::Baseline });

    #[inline(always)]
    fn map<T: Scalar>(&self, s: DepthState<T>, [pxx, pxy, pyy, pr]: [T; 4], _: &Context) -> T {
        let x = s.x - s.rho * self.baseline_mm;
        s.rho + pxx * x * x + pxy * x * s.y + pyy * s.y * s.y + pr * x * (x * x + s.y * s.y)
    }

    fn options(&self) -> Vec<(&'static str, f64)> {
        vec![("baseline_mm", self.baseline_mm)]
    }
}
