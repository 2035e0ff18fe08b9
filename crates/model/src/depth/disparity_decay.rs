use crate::field::{Field, Grid};
use crate::hook::{Depth, DepthState};
use crate::register::Options;
use crate::{Context, Parameter, Piece, Scalar};

/// An offset map whose strength decays exponentially with disparity: ρ_m = ρ + a(u, v) exp(−α (ρ − ρ₀)).
///
/// Disparity is proportional to ρ; ρ₀ = 1/m only makes a the offset at 1 m. The scale and the offset that turn corrected
/// disparity into depth (c1, c0 in Herrera's eq. 5) are D's dw and dz: [`crate::Register::depth_model`] adds them.
#[derive(Debug, Clone, Copy)]
pub struct DisparityDecay;

/// 1/mm.
const REFERENCE: f64 = 1e-3;

impl DisparityDecay {
    /// With cubic B-splines over the image, 8 × 6 coefficients unless said otherwise; α is one for all pixels.
    pub fn field(options: &Options) -> Field<Self, 2> {
        Field::with_shared(Self, Grid::cubic(8, 6).with_options(options), 1)
    }
}

impl Piece<Depth, 2> for DisparityDecay {
    const NAME: &'static str = "disparity_decay";
    const SOURCE: &'static str = "Herrera C., Kannala, Heikkilä 2012, Joint depth and color camera calibration, eq. 6";
    const PARAMETERS: [Parameter; 2] =
        [Parameter::new("a", "1/mm", 0.0, 1e-5), Parameter::new("alpha", "mm", 400.0, 200.0)];

    #[inline(always)]
    fn map<T: Scalar>(&self, s: DepthState<T>, [a, alpha]: [T; 2], _: &Context) -> T {
        s.rho + a * (alpha * (s.rho - REFERENCE) * -1.0).exp()
    }
}
