use crate::hook::Board;
use crate::{Context, Parameter, Piece, Scalar};

/// The print is stretched along y against x: Y (1 + sy). A common scale of both cannot be told from dw.
#[derive(Debug, Clone, Copy)]
pub struct PrintScale;

impl Piece<Board, 1> for PrintScale {
    const NAME: &'static str = "print_scale";
    const SOURCE: &'static str = "paper feed of printers";
    const PARAMETERS: [Parameter; 1] = [Parameter::new("sy", "1", 0.0, 1e-3)];

    #[inline(always)]
    fn map<T: Scalar>(&self, [x, y, z]: [T; 3], [sy]: [T; 1], _: &Context) -> [T; 3] {
        [x, y * (sy + 1.0), z]
    }
}
