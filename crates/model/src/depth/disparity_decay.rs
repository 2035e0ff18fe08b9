use crate::field::{Field, Grid};
use crate::hook::{Depth, DepthState};
use crate::piece::{Context, Options, Parameter, Piece, Scalar};

/// An offset map whose strength decays exponentially with disparity, which is proportional to ρ.
///
/// ρ₀ = 1/m only makes a the offset at 1 m. The scale and the offset that turn corrected disparity into depth (c1, c0 in
/// Herrera's eq. 5) are dw and dz of D, which [`Register::depth_model`](crate::Register::depth_model) adds.
#[derive(Debug, Clone, Copy)]
pub struct DisparityDecay;

/// ρ₀, 1/mm.
const REFERENCE: f64 = 1e-3;

impl DisparityDecay {
    /// Cubic B-splines over the image, with 8 × 6 coefficients unless `options` say otherwise; α is one for all pixels.
    pub fn field(options: &Options) -> Field<Self, 2> {
        Field::with_shared(Self, Grid::cubic(8, 6).with_options(options), 1)
    }
}

impl Piece<Depth, 2> for DisparityDecay {
    const NAME: &'static str = "disparity_decay";
    const SUMMARY: &'static str = "a smooth map over the image that decays with disparity";
    const EQUATION: &'static str = "ρ + a(u, v) exp(−α (ρ − ρ₀)), ρ₀ = 1/m";
    const SOURCE: &'static str = "Herrera C., Kannala, Heikkilä 2012, Joint depth and color camera calibration, eq. 6";
    const PARAMETERS: [Parameter; 2] = [
        Parameter::new("a", "1/mm", 0.0, 1e-5).meaning("Offset of inverse depth around this node, at 1 m."),
        Parameter::new("alpha", "mm", 400.0, 200.0).meaning("How fast the offsets decay with inverse depth."),
    ];
    const OFFSET_MAP: bool = true;

    #[inline(always)]
    fn map<T: Scalar>(&self, s: DepthState<T>, [a, alpha]: [T; 2], _: &Context) -> T {
        s.rho + a * (alpha * (s.rho - REFERENCE) * -1.0).exp()
    }
}
