use crate::hook::Board;
use crate::{Context, Parameter, Piece, Scalar};

/// The board is bent: a quadratic height z = bxx X² + bxy X Y + byy Y² over its own plane, bxy being its twist. Plane parts
/// are the pose's.
#[derive(Debug, Clone, Copy)]
pub struct BoardBow;

impl Piece<Board, 3> for BoardBow {
    const NAME: &'static str = "board_bow";
    const SOURCE: &'static str = "a board on a carrier that bends; second-order expansion of its surface";
    const PARAMETERS: [Parameter; 3] = [
        Parameter::new("bxx", "1/mm", 0.0, 1e-5),
        Parameter::new("bxy", "1/mm", 0.0, 1e-5),
        Parameter::new("byy", "1/mm", 0.0, 1e-5),
    ];

    #[inline(always)]
    fn map<T: Scalar>(&self, [x, y, z]: [T; 3], [bxx, bxy, byy]: [T; 3], _: &Context) -> [T; 3] {
        [x, y, z + bxx * x * x + bxy * x * y + byy * y * y]
    }
}
