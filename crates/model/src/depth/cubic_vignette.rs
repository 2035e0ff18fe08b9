use crate::hook::{Depth, DepthState};
use crate::piece::{Context, Parameter, Piece, Scalar};

/// ρ_m = ρ (1 + s r³), r the distance from the optical axis on the normalised image plane.
#[derive(Debug, Clone, Copy)]
pub struct CubicVignette;

impl Piece<Depth, 1> for CubicVignette {
    const NAME: &'static str = "cubic_vignette";
    const SUMMARY: &'static str = "depth is more and more wrong towards the corners";
    const EQUATION: &'static str = "ρ (1 + s r³)";
    const SOURCE: &'static str = "an example of a new depth model";
    const PARAMETERS: [Parameter; 1] = [Parameter::new("s", "1", 0.0, 1e-2)
        .meaning("Growth with the third power of the distance from the optical axis.")];

    #[inline(always)]
    fn map<T: Scalar>(&self, state: DepthState<T>, [s]: [T; 1], _: &Context) -> T {
        let r2 = state.x * state.x + state.y * state.y;
        // The small number keeps the derivative finite on the axis.
        let r3 = r2 * (r2 + 1e-12).sqrt();
        state.rho * (s * r3 + 1.0)
    }
}
