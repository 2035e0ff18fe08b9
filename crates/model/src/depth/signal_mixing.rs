use crate::hook::{Depth, DepthState};
use crate::piece::{Context, Covariate, Parameter, Piece, Scalar};
use crate::technology::Technology;

/// Signals of neighbouring pixels mix: optics and readout give every pixel a share of its neighbours' signal, which weighs
/// the more the darker the pixel is. Needs the mean amplitude Ā around the pixel ([`Context::surround`]) and its slope; no
/// effect where they or the pixel's own amplitude A are unknown or zero.
#[derive(Debug, Clone, Copy)]
pub struct SignalMixing;

impl Piece<Depth, 4> for SignalMixing {
    const NAME: &'static str = "signal_mixing";
    const SUMMARY: &'static str = "bright neighbours pull at the depth of darker pixels";
    const EQUATION: &'static str =
        "z + m1 ℓ + m2 ℓ² + su ∂ln Ā/∂u + sv ∂ln Ā/∂v, ℓ = ln(Ā/A), mean amplitude Ā around the pixel";
    const SOURCE: &'static str = "Mure-Dubois, Hügli 2007, Optimized scattering compensation for time-of-flight camera";
    const TECHNOLOGIES: &'static [Technology] = &[Technology::TimeOfFlight];
    const PARAMETERS: [Parameter; 4] = [
        Parameter::new("m1", "mm", 0.0, 2.0)
            .meaning("Bright neighbours pull at dark pixels: grows with surroundings over own signal."),
        Parameter::new("m2", "mm", 0.0, 1.0).meaning("The same, with the square of its logarithm."),
        Parameter::new("su", "mm px", 0.0, 10.0).meaning("The same at edges: the slope of the brightness across."),
        Parameter::new("sv", "mm px", 0.0, 10.0).meaning("The same at edges: the slope of the brightness down."),
    ];
    const NEEDS: &'static [Covariate] = &[Covariate::Amplitude, Covariate::Surroundings];

    #[inline(always)]
    fn map<T: Scalar>(&self, s: DepthState<T>, [m1, m2, su, sv]: [T; 4], c: &Context) -> T {
        if !(c.amplitude > 0.0 && c.surround > 0.0) {
            return s.rho;
        }
        let l = (c.surround / c.amplitude).ln();
        let bias = (m2 * l + m1) * l + su * c.slope[0] + sv * c.slope[1];
        s.rho / (bias * s.rho + 1.0)
    }
}
