use crate::hook::Board;
use crate::piece::{BoardSide, Constant, Context, Options, Parameter, Piece, Scalar};

// Files without these constants have the bow about the board's origin.
const WIDTH: Constant = Constant::new("width_mm", "width", "mm", 0.0).of_board(BoardSide::Width);
const HEIGHT: Constant = Constant::new("height_mm", "height", "mm", 0.0).of_board(BoardSide::Height);

/// The board is bent: a quadratic height over its own plane, of which bxy is the twist. The pose takes up any plane part.
///
/// It bends about the middle of its markers: a sheet that bends keeps the distances along its surface, which the coordinates in
/// its plane have but for terms of second order in the slope; these are least over the plane that touches it in the middle.
#[derive(Debug, Clone, Copy)]
pub struct BoardBow {
    /// The middle, mm.
    pub middle_mm: [f64; 2],
}

impl BoardBow {
    /// With the constants that are given by name, and defaults for the others.
    pub fn with_options(given: &Options) -> Self {
        Self { middle_mm: [WIDTH.of(given) / 2.0, HEIGHT.of(given) / 2.0] }
    }
}

impl Piece<Board, 3> for BoardBow {
    const NAME: &'static str = "board_bow";
    const SUMMARY: &'static str = "the board is bent";
    const EQUATION: &'static str = "Z + bxx X² + bxy X Y + byy Y², X and Y from the middle of the markers";
    const SOURCE: &'static str = "a board on a carrier that bends; second-order expansion of its surface";
    const PARAMETERS: [Parameter; 3] = [
        Parameter::new("bxx", "1/mm", 0.0, 1e-5).meaning("The board bends along its rows."),
        Parameter::new("bxy", "1/mm", 0.0, 1e-5).meaning("The board is twisted."),
        Parameter::new("byy", "1/mm", 0.0, 1e-5).meaning("The board bends along its columns."),
    ];
    const CONSTANTS: &'static [Constant] = &[WIDTH, HEIGHT];

    #[inline(always)]
    fn map<T: Scalar>(&self, [x, y, z]: [T; 3], [bxx, bxy, byy]: [T; 3], _: &Context) -> [T; 3] {
        let (p, q) = (x - self.middle_mm[0], y - self.middle_mm[1]);
        [x, y, z + bxx * p * p + bxy * p * q + byy * q * q]
    }

    fn options(&self) -> Vec<(&'static str, f64)> {
        let [x, y] = self.middle_mm;
        vec![(WIDTH.name, 2.0 * x), (HEIGHT.name, 2.0 * y)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Height and slopes are zero in the middle of the board, and about the origin in files that do not have its size.
    #[test]
    fn it_touches_its_plane_in_the_middle() {
        let height = |bow: BoardBow, x: f64, y: f64| bow.map([x, y, 0.0], [2e-4, 1e-4, 3e-4], &Context::default())[2];
        let sized = Options::from([("width_mm".to_owned(), 120.0), ("height_mm".to_owned(), 170.0)]);
        for (options, [x, y]) in [(sized, [60.0, 85.0]), (Options::new(), [0.0, 0.0])] {
            let bow = BoardBow::with_options(&options);
            assert_eq!(height(bow, x, y), 0.0);
            for (dx, dy) in [(1.0, 0.0), (0.0, 1.0), (1.0, -1.0)] {
                assert_eq!(height(bow, x + dx, y + dy), height(bow, x - dx, y - dy), "{options:?}");
            }
            let written = bow.options().into_iter().map(|(name, value)| (name.to_owned(), value)).collect();
            assert_eq!(BoardBow::with_options(&written).middle_mm, bow.middle_mm);
        }
    }
}
