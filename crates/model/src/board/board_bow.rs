use crate::hook::Board;
use crate::piece::{Context, Parameter, Piece, Scalar};

/// The board is bent: a quadratic height over its own plane, of which bxy is the twist. The pose takes up any plane part.
#[derive(Debug, Clone, Copy)]
pub struct BoardBow;

impl Piece<Board, 3> for BoardBow {
    const NAME: &'static str = "board_bow";
    const SUMMARY: &'static str = "the board is bent";
    const EQUATION: &'static str = "Z + bxx X² + bxy X Y + byy Y²";
    const SOURCE: &'static str = "a board on a carrier that bends; second-order expansion of its surface";
    const PARAMETERS: [Parameter; 3] = [
        Parameter::new("bxx", "1/mm", 0.0, 1e-5).meaning("The board bends along its rows."),
        Parameter::new("bxy", "1/mm", 0.0, 1e-5).meaning("The board is twisted."),
        Parameter::new("byy", "1/mm", 0.0, 1e-5).meaning("The board bends along its columns."),
    ];

    #[inline(always)]
    fn map<T: Scalar>(&self, [x, y, z]: [T; 3], [bxx, bxy, byy]: [T; 3], _: &Context) -> [T; 3] {
        [x, y, z + bxx * x * x + bxy * x * y + byy * y * y]
    }
}
