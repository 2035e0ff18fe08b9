//! Signals of neighbouring pixels mix.

use crate::hook::{Depth, DepthState};
use crate::{Context, Parameter, Piece, Scalar};

/// Bias in depth that grows with the logarithm l of the amplitude about a pixel over its own: optics and readout give every
/// pixel a share of its neighbours' signal, which weighs the more the darker the pixel is. Measured from mean amplitude
/// and its slope (see [`Context::surround`]): δz = m1 l + m2 l² + su ∂ln A/∂u + sv ∂ln A/∂v.
#[derive(Debug, Clone, Copy)]
pub struct SignalMixing;

impl Piece<Depth, 4> for SignalMixing {
    const NAME: &'static str = "signal_mixing";
    const SOURCE: &'static str = "Mure-Dubois, Hügli 2007, Optimized scattering compensation for time-of-flight camera";
    const PARAMETERS: [Parameter; 4] = [
        Parameter::new("m1", "mm", 0.0, 2.0),
        Parameter::new("m2", "mm", 0.0, 1.0),
        Parameter::new("su", "mm px", 0.0, 10.0),
        Parameter::new("sv", "mm px", 0.0, 10.0),
    ];

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
