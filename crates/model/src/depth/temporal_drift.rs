use crate::hook::{Depth, DepthState};
use crate::register::Options;
use crate::{Context, Covariate, Parameter, Piece, Scalar, Scan, ScanKind};

/// Warm-up: scale and offset in inverse depth that settle with time, ρ_m = ρ (1 + s g) + o g, g = 1 − exp(−t / τ); an
/// infinite τ makes it linear in t (per hour).
#[derive(Debug, Clone, Copy)]
pub struct TemporalDrift {
    /// Time constant τ, s.
    pub tau_s: f64,
}

impl TemporalDrift {
    /// With the constants that are given by name, and defaults for the others.
    pub fn with_options(options: &Options) -> Self {
        let option = |name: &str, default: f64| options.get(name).copied().unwrap_or(default);
        Self { tau_s: option("tau_s", 300.0) }
    }
}

impl Piece<Depth, 2> for TemporalDrift {
    const NAME: &'static str = "temporal_drift";
    const SOURCE: &'static str =
        "Fiedler, Müller 2013, Impact of thermal and environmental conditions on the Kinect sensor";
    const PARAMETERS: [Parameter; 2] = [Parameter::new("s", "1", 0.0, 1e-3), Parameter::new("o", "1/mm", 0.0, 1e-6)];
    const SCAN: Option<Scan> =
        Some(Scan { constant: "tau_s", covariate: Covariate::Time, kind: ScanKind::TimeConstant });

    #[inline(always)]
    fn map<T: Scalar>(&self, state: DepthState<T>, [s, o]: [T; 2], c: &Context) -> T {
        let linear = c.time_s / 3600.0;
        let settled = if self.tau_s.is_finite() { 1.0 - (-c.time_s / self.tau_s).exp() } else { linear };
        state.rho * (s * settled + 1.0) + o * settled
    }
    fn options(&self) -> Vec<(&'static str, f64)> {
        vec![("tau_s", self.tau_s)]
    }
}
