use crate::hook::{Depth, DepthState};
use crate::register::Options;
use crate::{Context, Covariate, Parameter, Piece, Scalar, Scan, ScanKind};

/// Depth depends on the infrared amplitude A: z_m = z + b1 ℓ + b2 ℓ² + b3 ℓ³, ℓ = ln(A / A₀). No effect where the
/// amplitude is unknown or zero.
#[derive(Debug, Clone, Copy)]
pub struct ReflectivityBias {
    /// Amplitude A₀ at which nothing is added, in the image's steps.
    pub reference: f64,
}

impl ReflectivityBias {
    /// With the constants that are given by name, and defaults for the others.
    pub fn with_options(options: &Options) -> Self {
        let option = |name: &str, default: f64| options.get(name).copied().unwrap_or(default);
        Self { reference: option("reference", 1000.0) }
    }
}

impl Piece<Depth, 3> for ReflectivityBias {
    const NAME: &'static str = "reflectivity_bias";
    const SOURCE: &'static str =
        "Lindner, Schiller, Kolb, Koch 2010, Time-of-flight sensor calibration for accurate range sensing";
    const PARAMETERS: [Parameter; 3] = [
        Parameter::new("b1", "mm", 0.0, 2.0),
        Parameter::new("b2", "mm", 0.0, 1.0),
        Parameter::new("b3", "mm", 0.0, 1.0),
    ];
    const SCAN: Option<Scan> =
        Some(Scan { constant: "reference", covariate: Covariate::Amplitude, kind: ScanKind::Reference });

    #[inline(always)]
    fn map<T: Scalar>(&self, s: DepthState<T>, [b1, b2, b3]: [T; 3], c: &Context) -> T {
        let l = if c.amplitude > 0.0 { (c.amplitude / self.reference).ln() } else { 0.0 };
        let bias = ((b3 * l + b2) * l + b1) * l;
        s.rho / (bias * s.rho + 1.0)
    }
    fn options(&self) -> Vec<(&'static str, f64)> {
        vec![("reference", self.reference)]
    }
}
