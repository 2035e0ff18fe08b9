use crate::hook::{Depth, DepthState};
use crate::piece::{Constant, Context, Covariate, Options, Parameter, Piece, Scalar, ScanKind};

const REFERENCE: Constant =
    Constant::new("reference", "reference amplitude", "1", 1000.0).searched(Covariate::Amplitude, ScanKind::Reference);

/// Depth depends on the infrared amplitude A of the pixel. No effect where the amplitude is unknown or zero.
#[derive(Debug, Clone, Copy)]
pub struct ReflectivityBias {
    /// Amplitude A₀ at which nothing is added, in steps of the image.
    pub reference: f64,
}

impl ReflectivityBias {
    /// With the constants that are given by name, and defaults for the others.
    pub fn with_options(given: &Options) -> Self {
        Self { reference: REFERENCE.of(given) }
    }
}

impl Piece<Depth, 3> for ReflectivityBias {
    const NAME: &'static str = "reflectivity_bias";
    const SUMMARY: &'static str = "depth depends on how bright the pixel is";
    const EQUATION: &'static str = "z + b1 ℓ + b2 ℓ² + b3 ℓ³, ℓ = ln(A/A₀), amplitude A";
    const SOURCE: &'static str =
        "Lindner, Schiller, Kolb, Koch 2010, Time-of-flight sensor calibration for accurate range sensing";
    const PARAMETERS: [Parameter; 3] = [
        Parameter::new("b1", "mm", 0.0, 2.0).meaning("Error of depth that grows with the logarithm of the brightness."),
        Parameter::new("b2", "mm", 0.0, 1.0).meaning("The same, with its square."),
        Parameter::new("b3", "mm", 0.0, 1.0).meaning("The same, with its cube."),
    ];
    const CONSTANTS: &'static [Constant] = &[REFERENCE];
    const NEEDS: &'static [Covariate] = &[Covariate::Amplitude];

    #[inline(always)]
    fn map<T: Scalar>(&self, s: DepthState<T>, [b1, b2, b3]: [T; 3], c: &Context) -> T {
        let l = if c.amplitude > 0.0 { (c.amplitude / self.reference).ln() } else { 0.0 };
        let bias = ((b3 * l + b2) * l + b1) * l;
        s.rho / (bias * s.rho + 1.0)
    }
    fn options(&self) -> Vec<(&'static str, f64)> {
        vec![(REFERENCE.name, self.reference)]
    }
}
