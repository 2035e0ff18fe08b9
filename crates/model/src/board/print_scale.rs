use crate::hook::Board;
use crate::piece::{Context, Parameter, Piece, Scalar};

/// The print is stretched along y against x. A common scale of both cannot be told from dw of D.
#[derive(Debug, Clone, Copy)]
pub struct PrintScale;

impl Piece<Board, 1> for PrintScale {
    const NAME: &'static str = "print_scale";
    const SUMMARY: &'static str = "the print is stretched along one axis";
    const EQUATION: &'static str = "Y (1 + sy)";
    const SOURCE: &'static str = "paper feed of printers";
    const PARAMETERS: [Parameter; 1] =
        [Parameter::new("sy", "1", 0.0, 1e-3).meaning("Stretch of the print along y against x.")];

    #[inline(always)]
    fn map<T: Scalar>(&self, [x, y, z]: [T; 3], [sy]: [T; 1], _: &Context) -> [T; 3] {
        [x, y * (sy + 1.0), z]
    }
}
