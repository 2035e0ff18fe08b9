use crate::hook::{Depth, DepthState};
use crate::piece::{Context, Covariate, Parameter, Piece, Scalar};

/// The spot smears on slanted surfaces, which biases depth by the angle θ between ray and normal.
#[derive(Debug, Clone, Copy)]
pub struct IncidenceBias;

impl Piece<Depth, 1> for IncidenceBias {
    const NAME: &'static str = "incidence_bias";
    const SUMMARY: &'static str = "surfaces seen at a slant are measured wrong";
    const EQUATION: &'static str = "z + b (1/cos θ − 1), θ between ray and normal";
    const SOURCE: &'static str =
        "Soudarissanane et al. 2011, Scanning geometry: influencing factor on the quality of range measurements";
    const PARAMETERS: [Parameter; 1] =
        [Parameter::new("b", "mm", 0.0, 5.0).meaning("Error of depth that grows on surfaces seen at a slant.")];
    const NEEDS: &'static [Covariate] = &[Covariate::Incidence];

    #[inline(always)]
    fn map<T: Scalar>(&self, s: DepthState<T>, [b]: [T; 1], _: &Context) -> T {
        let bias = b * (s.cos_incidence.recip() - 1.0);
        s.rho / (bias * s.rho + 1.0)
    }
}
