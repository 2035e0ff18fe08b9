use crate::hook::Board;
use crate::piece::{Constant, Context, Options, Parameter, Piece, Scalar};

const WIDTH: Constant =
    Constant::new("width", "width", "mm", 400.0);

/// The board's shape depends on x on the board (mm) and y on the board (mm) by a formula.
#[derive(Debug, Clone, Copy)]
pub struct Sag {
    /// Constant width of the formula, mm.
    pub width: f64,
}

impl Sag {
    /// With the constants that are given by name, and defaults for the others.
    pub fn with_options(given: &Options) -> Self {
        Self { width: WIDTH.of(given) }
    }
}

impl Piece<Board, 1> for Sag {
    const NAME: &'static str = "sag";
    const SUMMARY: &'static str = "the board's shape depends on x on the board (mm) and y on the board (mm) by a formula";
    const EQUATION: &'static str = "Z + a sin(π X_b/width) cos(Y_b/width)";
    const SOURCE: &'static str = "a formula of the user";
    const PARAMETERS: [Parameter; 1] = [
        Parameter::new("a", "mm", 0.0, 0.464).meaning("Parameter a of the formula a * sin(pi * board_x / width) * cos(board_y / width)."),
    ];
    const CONSTANTS: &'static [Constant] = &[WIDTH];

    #[inline(always)]
    fn map<T: Scalar>(&self, [board_x, board_y, board_z]: [T; 3], [a]: [T; 1], _: &Context) -> [T; 3] {
        [board_x, board_y, board_z + ((a * ((board_x * std::f64::consts::PI) / self.width).sin()) * (board_y / self.width).cos())]
    }
    fn options(&self) -> Vec<(&'static str, f64)> {
        vec![(WIDTH.name, self.width)]
    }
}
