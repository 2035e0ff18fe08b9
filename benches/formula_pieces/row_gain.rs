//! The effect `row_gain` of effects.toml in Rust.

use crate::hook::{Depth, DepthState};
use crate::piece::{Constant, Context, On, Options, Parameter, Piece, Scalar};

const RHO0: Constant = Constant::new("rho0", "rho0", "1/mm", 0.00125);

/// Disparity grows from row to row, with the logarithm of the distance.
#[derive(Debug, Clone, Copy)]
pub struct RowGain {
    /// Constant rho0 of the formula, 1/mm.
    pub rho0: f64,
}

impl RowGain {
    /// With the constants that are given by name, and defaults for the others.
    pub fn with_options(given: &Options) -> Self {
        Self { rho0: RHO0.of(given) }
    }
}

impl Piece<Depth, 1> for RowGain {
    const NAME: &'static str = "row_gain";
    const SUMMARY: &'static str = "disparity grows from row to row, with the logarithm of the distance";
    const EQUATION: &'static str = "ρ + a y ln(ρ/ρ₀)";
    const SOURCE: &'static str = "a formula of the user";
    const PARAMETERS: [Parameter; 1] =
        [Parameter::new("a", "1/mm", 0.0, 6.16e-6).meaning("Parameter a of the formula a * y * log(rho / rho0).")];
    const CONSTANTS: &'static [Constant] = &[RHO0];
    const FORM: On = On::InverseDepth;

    #[inline(always)]
    fn map<T: Scalar>(&self, s: DepthState<T>, [a]: [T; 1], _: &Context) -> T {
        let y = s.y;
        let rho = s.rho;
        let e = (a * y) * (rho / self.rho0).ln();
        s.rho + e
    }
    fn options(&self) -> Vec<(&'static str, f64)> {
        vec![(RHO0.name, self.rho0)]
    }
}
