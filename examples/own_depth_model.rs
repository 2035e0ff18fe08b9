//! A complete `depthcal` with a depth model from outside its crates: an error that grows with the third power of the distance
//! from the optical axis. Every command knows it by its name, like the built-in models:
//!
//! ```text
//! cargo run --release --example own_depth_model -- calibrate captures/ --model projective+cubic_vignette --out result/
//! cargo run --release --example own_depth_model -- compare captures/ \
//!     --models projective,projective+cubic_vignette --out compared/
//! cargo run --release --example own_depth_model -- diagnose captures/ --out diagnosed/
//! cargo run --release --example own_depth_model -- apply result/calibration.json captures/ --out corrected/
//! ```

use std::process::ExitCode;

use depthcal::model::hook::{Depth, DepthState};
use depthcal::model::{Context, Parameter, Piece, Register, Scalar};

/// ρ_m = ρ (1 + s r³), r the distance from the optical axis on the normalised image plane.
#[derive(Debug)]
struct CubicVignette;

impl Piece<Depth, 1> for CubicVignette {
    const NAME: &'static str = "cubic_vignette";
    const SUMMARY: &'static str = "depth grows wrong towards the corners";
    const EQUATION: &'static str = "ρ (1 + s r³)";
    const SOURCE: &'static str = "an example";
    const PARAMETERS: [Parameter; 1] = [Parameter::new("s", "1", 0.0, 1e-2)
        .meaning("Growth with the third power of the distance from the optical axis.")];

    fn map<T: Scalar>(&self, state: DepthState<T>, [s]: [T; 1], _: &Context) -> T {
        let r2 = state.x * state.x + state.y * state.y;
        // The small number keeps the derivative finite on the axis.
        let r3 = r2 * (r2 + 1e-12).sqrt();
        state.rho * (s * r3 + 1.0)
    }
}

fn main() -> ExitCode {
    let mut register = Register::builtin();
    register.add(|_| CubicVignette);
    depthcal::cli::run(register)
}
