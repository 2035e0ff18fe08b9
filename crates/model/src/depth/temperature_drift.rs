use crate::hook::{Depth, DepthState};
use crate::register::Options;
use crate::{Context, Covariate, Parameter, Piece, Scalar, Scan, ScanKind};

/// Scale and offset in inverse depth, linear in the temperature: ρ_m = ρ (1 + s ΔT) + o ΔT, ΔT = T − T₀. No effect where
/// the temperature is unknown.
#[derive(Debug, Clone, Copy)]
pub struct TemperatureDrift {
    /// Temperature T₀ at which nothing is added, °C.
    pub reference_c: f64,
}

impl TemperatureDrift {
    /// With the constants that are given by name, and defaults for the others.
    pub fn with_options(options: &Options) -> Self {
        let option = |name: &str, default: f64| options.get(name).copied().unwrap_or(default);
        Self { reference_c: option("reference_c", 25.0) }
    }
}

impl Piece<Depth, 2> for TemperatureDrift {
    const NAME: &'static str = "temperature_drift";
    const SOURCE: &'static str =
        "Fiedler, Müller 2013, Impact of thermal and environmental conditions on the Kinect sensor";
    const PARAMETERS: [Parameter; 2] =
        [Parameter::new("s", "1/K", 0.0, 1e-4), Parameter::new("o", "1/(mm K)", 0.0, 1e-7)];
    const SCAN: Option<Scan> =
        Some(Scan { constant: "reference_c", covariate: Covariate::Temperature, kind: ScanKind::Reference });

    #[inline(always)]
    fn map<T: Scalar>(&self, state: DepthState<T>, [s, o]: [T; 2], c: &Context) -> T {
        let excess = if c.temperature_c.is_finite() { c.temperature_c - self.reference_c } else { 0.0 };
        state.rho * (s * excess + 1.0) + o * excess
    }
    fn options(&self) -> Vec<(&'static str, f64)> {
        vec![("reference_c", self.reference_c)]
    }
}
