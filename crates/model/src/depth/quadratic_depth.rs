use crate::hook::{Depth, DepthState};
use crate::piece::{Context, Parameter, Piece, Scalar};

/// An error of second and third order in depth.
#[derive(Debug, Clone, Copy)]
pub struct QuadraticDepth;

impl Piece<Depth, 2> for QuadraticDepth {
    const NAME: &'static str = "quadratic_depth";
    const SUMMARY: &'static str = "the error grows with the square of the distance";
    const EQUATION: &'static str = "z + q2 z² + q3 z³";
    const SOURCE: &'static str =
        "Khoshelham, Elberink 2012; Basso, Menegatti, Pretto 2018, systematic error of the global depth";
    const PARAMETERS: [Parameter; 2] = [
        Parameter::new("q2", "1/mm", 0.0, 1e-5).meaning("The error grows with the square of the distance."),
        Parameter::new("q3", "1/mm²", 0.0, 1e-8).meaning("The error grows with the cube of the distance."),
    ];

    #[inline(always)]
    fn map<T: Scalar>(&self, s: DepthState<T>, [q2, q3]: [T; 2], _: &Context) -> T {
        let z = s.rho.recip();
        s.rho / ((q3 * z + q2) * z + 1.0)
    }
}
