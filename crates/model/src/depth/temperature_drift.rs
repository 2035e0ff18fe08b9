use crate::hook::{Depth, DepthState};
use crate::piece::{Constant, Context, Covariate, On, Options, Parameter, Piece, Scalar, ScanKind};

const REFERENCE: Constant = Constant::new("reference_c", "reference temperature", "°C", 25.0)
    .searched(Covariate::Temperature, ScanKind::Reference);

/// Scale and offset in inverse depth that are linear in the temperature T. No effect where the temperature is unknown.
#[derive(Debug, Clone, Copy)]
pub struct TemperatureDrift {
    /// Temperature T₀ at which nothing is added, °C.
    pub reference_c: f64,
}

impl TemperatureDrift {
    /// With the constants that are given by name, and defaults for the others.
    pub fn with_options(given: &Options) -> Self {
        Self { reference_c: REFERENCE.of(given) }
    }
}

impl Piece<Depth, 2> for TemperatureDrift {
    const NAME: &'static str = "temperature_drift";
    const SUMMARY: &'static str = "depth changes with temperature";
    const EQUATION: &'static str = "ρ (1 + s ΔT) + o ΔT, ΔT = T − T₀";
    const SOURCE: &'static str =
        "Fiedler, Müller 2013, Impact of thermal and environmental conditions on the Kinect sensor";
    const PARAMETERS: [Parameter; 2] = [
        Parameter::new("s", "1/K", 0.0, 1e-4).meaning("The scale of inverse depth changes with temperature."),
        Parameter::new("o", "1/(mm K)", 0.0, 1e-7).meaning("The offset of inverse depth changes with temperature."),
    ];
    const CONSTANTS: &'static [Constant] = &[REFERENCE];
    const NEEDS: &'static [Covariate] = &[Covariate::Temperature];
    const FORM: On = On::InverseDepth;

    #[inline(always)]
    fn map<T: Scalar>(&self, state: DepthState<T>, [s, o]: [T; 2], c: &Context) -> T {
        let excess = if c.temperature_c.is_finite() { c.temperature_c - self.reference_c } else { 0.0 };
        state.rho * (s * excess + 1.0) + o * excess
    }
    fn options(&self) -> Vec<(&'static str, f64)> {
        vec![(REFERENCE.name, self.reference_c)]
    }
}
