use crate::hook::{Depth, DepthState};
use crate::piece::{Constant, Context, Covariate, On, Options, Parameter, Piece, Scalar, ScanKind};

const TAU: Constant =
    Constant::new("tau_s", "time constant", "s", 300.0).searched(Covariate::Time, ScanKind::TimeConstant);

/// Warm-up: scale and offset in inverse depth that settle with time t. An infinite time constant makes them linear in t, per
/// hour.
#[derive(Debug, Clone, Copy)]
pub struct TemporalDrift {
    /// Time constant τ, s.
    pub tau_s: f64,
}

impl TemporalDrift {
    /// With the constants that are given by name, and defaults for the others.
    pub fn with_options(given: &Options) -> Self {
        Self { tau_s: TAU.of(given) }
    }
}

impl Piece<Depth, 2> for TemporalDrift {
    const NAME: &'static str = "temporal_drift";
    const SUMMARY: &'static str = "depth drifts while the camera settles";
    const EQUATION: &'static str = "ρ (1 + s g) + o g, g = 1 − exp(−t/τ)";
    const SOURCE: &'static str =
        "Fiedler, Müller 2013, Impact of thermal and environmental conditions on the Kinect sensor";
    const PARAMETERS: [Parameter; 2] = [
        Parameter::new("s", "1", 0.0, 1e-3).meaning("The scale of inverse depth drifts while the camera settles."),
        Parameter::new("o", "1/mm", 0.0, 1e-6).meaning("The offset of inverse depth drifts while the camera settles."),
    ];
    const CONSTANTS: &'static [Constant] = &[TAU];
    const NEEDS: &'static [Covariate] = &[Covariate::Time];
    const FORM: On = On::InverseDepth;

    #[inline(always)]
    fn map<T: Scalar>(&self, state: DepthState<T>, [s, o]: [T; 2], c: &Context) -> T {
        let linear = c.time_s / 3600.0;
        let settled = if self.tau_s.is_finite() { 1.0 - (-c.time_s / self.tau_s).exp() } else { linear };
        state.rho * (s * settled + 1.0) + o * settled
    }
    fn options(&self) -> Vec<(&'static str, f64)> {
        vec![(TAU.name, self.tau_s)]
    }
}
