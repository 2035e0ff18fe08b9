use crate::hook::{Depth, DepthState};
use crate::{Context, Parameter, Piece, Scalar};

/// The spot smears on slanted surfaces: z_m = z + b (1 / cos θ − 1), θ between ray and normal.
#[derive(Debug, Clone, Copy)]
pub struct IncidenceBias;

impl Piece<Depth, 1> for IncidenceBias {
    const NAME: &'static str = "incidence_bias";
    const SOURCE: &'static str =
        "Soudarissanane et al. 2011, Scanning geometry: influencing factor on the quality of range measurements";
    const PARAMETERS: [Parameter; 1] = [Parameter::new("b", "mm", 0.0, 5.0)];

    #[inline(always)]
    fn map<T: Scalar>(&self, s: DepthState<T>, [b]: [T; 1], _: &Context) -> T {
        let bias = b * (s.cos_incidence.recip() - 1.0);
        s.rho / (bias * s.rho + 1.0)
    }
}
