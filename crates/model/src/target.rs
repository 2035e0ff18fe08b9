//! The board: which markers it has and where they lie.
//!
//! Board frame: x along a row to the right, y down the columns, z away from a viewer who looks at the print, all in
//! mm, the first marker at (or near) the origin. It is the frame that OpenCV's own examples use.

use serde::{Deserialize, Serialize};

/// The pattern printed on the board. Lengths in mm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Pattern {
    /// Dots whose odd rows are shifted by one spacing: dot (row i, column j) at ((2 j + i mod 2) s, i s).
    AsymmetricCircles {
        /// Diameter of a dot; 0, and absent in files, where it is not known: then it is measured in the images.
        #[serde(default, skip_serializing_if = "is_unknown")]
        circle_diameter_mm: f64,
    },
    /// Dots on a square grid: (j s, i s).
    SymmetricCircles {
        /// Diameter of a dot; 0, and absent in files, where it is not known: then it is measured in the images.
        #[serde(default, skip_serializing_if = "is_unknown")]
        circle_diameter_mm: f64,
    },
    /// Inner corners of a chessboard on a square grid: (j s, i s).
    Chessboard,
    /// A chessboard with ArUco markers in its white squares. `columns` and `rows` count squares, as in OpenCV; the
    /// markers are the (columns − 1)(rows − 1) inner corners at ((j + 1) s, (i + 1) s).
    Charuco {
        /// Side of an ArUco marker.
        marker_mm: f64,
        /// OpenCV's name of the dictionary, for example `DICT_5X5_100`.
        dictionary: String,
    },
    /// A grid of `columns` × `rows` AprilTags (family 36h11); the spacing is the pitch of the tags. Tag t = i · columns
    /// + j has its four corners, clockwise from the top left, as markers 4 t … 4 t + 3.
    Aprilgrid {
        /// Side of a tag, outer edge of its black border.
        marker_mm: f64,
    },
    /// Several boards at once, each rigid but not with the others, told apart by the numbers of their tags. The markers of the
    /// first come first. Columns and rows are 0.
    Several {
        /// The boards, ChArUco boards and AprilGrids.
        boards: Vec<NumberedBoard>,
    },
}

/// One of several boards.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct NumberedBoard {
    /// Its name.
    pub name: String,
    /// Number of its first tag in the dictionary; the others follow.
    #[serde(default)]
    pub first_tag: usize,
    /// The board.
    pub board: Target,
}

/// A board among the markers of a [`Target`], which has one or several.
#[derive(Debug, Clone, PartialEq)]
pub struct BoardPart<'a> {
    /// Its name; empty where there is one board only.
    pub name: &'a str,
    /// Number of its first tag.
    pub first_tag: usize,
    /// The board.
    pub board: &'a Target,
    /// Its markers among those of all boards.
    pub markers: std::ops::Range<usize>,
}

impl BoardPart<'_> {
    /// Suffix that makes an image's name that of its frame of this board; empty for the first board.
    fn ending(&self) -> String {
        if self.markers.start == 0 { String::new() } else { format!("+{}", self.name) }
    }

    /// Name of the frame of this board in an image of this name.
    pub fn frame_name(&self, image: &str) -> String {
        format!("{image}{}", self.ending())
    }

    /// The inverse of [`BoardPart::frame_name`].
    pub fn image_name<'a>(&self, frame: &'a str) -> &'a str {
        frame.strip_suffix(&self.ending()).unwrap_or(frame)
    }
}

/// Which square is at the top left of a ChArUco board with an even number of rows. With an odd number there is but one layout.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CharucoLayout {
    /// A black one: as OpenCV draws boards since 4.6.
    Current,
    /// A white one with a marker: as OpenCV drew boards before 4.6, and does with `setLegacyPattern`.
    Legacy,
}

impl CharucoLayout {
    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            CharucoLayout::Current => "current",
            CharucoLayout::Legacy => "legacy",
        }
    }

    /// The inverse of [`CharucoLayout::name`].
    pub fn named(name: &str) -> Option<CharucoLayout> {
        [CharucoLayout::Current, CharucoLayout::Legacy].into_iter().find(|layout| layout.name() == name)
    }
}

impl std::fmt::Display for CharucoLayout {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            CharucoLayout::Current => "a black square at the top left, as OpenCV draws it since 4.6",
            CharucoLayout::Legacy => "a marker at the top left, as OpenCV drew it before 4.6 (legacy pattern)",
        })
    }
}

fn is_unknown(length_mm: &f64) -> bool {
    *length_mm == 0.0
}

/// A calibration board: the pattern and its size.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Target {
    /// The pattern.
    #[serde(flatten)]
    pub pattern: Pattern,
    /// Markers in a row (squares for ChArUco, tags for AprilGrid).
    pub columns: usize,
    /// Rows.
    pub rows: usize,
    /// Grid spacing in mm; for asymmetric circles the distance between neighbouring rows.
    pub spacing_mm: f64,
}

impl Target {
    /// Several boards at once, told apart by the numbers of their tags. `spacing_mm` is that of the first.
    pub fn several(boards: Vec<NumberedBoard>) -> Self {
        let spacing_mm = boards.first().map_or(f64::NAN, |first| first.board.spacing_mm);
        Self { pattern: Pattern::Several { boards }, columns: 0, rows: 0, spacing_mm }
    }

    /// The boards: this one, or the several that it consists of.
    pub fn parts(&self) -> Vec<BoardPart<'_>> {
        let Pattern::Several { boards } = &self.pattern else {
            return vec![BoardPart { name: "", first_tag: 0, board: self, markers: 0..self.len() }];
        };
        let mut next = 0;
        let mut parts = Vec::new();
        for NumberedBoard { name, first_tag, board } in boards {
            let markers = next..next + board.len();
            next = markers.end;
            parts.push(BoardPart { name, first_tag: *first_tag, board, markers });
        }
        parts
    }

    /// The markers of one of the boards, by its number: index and position in its frame, mm. None beyond the last board.
    pub fn points_of(&self, board: usize) -> Vec<(usize, [f64; 2])> {
        let range = self.parts().get(board).map_or(0..0, |part| part.markers.clone());
        range.map(|index| (index, self.point(index))).collect()
    }

    /// Number of markers that a complete detection has.
    pub fn len(&self) -> usize {
        match self.pattern {
            Pattern::Charuco { .. } => self.columns.saturating_sub(1) * self.rows.saturating_sub(1),
            Pattern::Aprilgrid { .. } => 4 * self.columns * self.rows,
            Pattern::Several { ref boards } => boards.iter().map(|part| part.board.len()).sum(),
            _ => self.columns * self.rows,
        }
    }

    /// Whether the board has no markers at all.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Position of marker `index` (row-major) in the board frame, mm; the board is flat, z = 0.
    pub fn point(&self, index: usize) -> [f64; 2] {
        let s = self.spacing_mm;
        let grid = |columns: usize| ((index % columns) as f64, (index / columns) as f64);
        match &self.pattern {
            Pattern::Several { boards } => {
                let mut left = index;
                for NumberedBoard { board, .. } in boards {
                    if left < board.len() {
                        return board.point(left);
                    }
                    left -= board.len();
                }
                [f64::NAN; 2]
            }
            Pattern::AsymmetricCircles { .. } => {
                let (j, i) = grid(self.columns);
                [(2.0 * j + i % 2.0) * s, i * s]
            }
            Pattern::SymmetricCircles { .. } | Pattern::Chessboard => {
                let (j, i) = grid(self.columns);
                [j * s, i * s]
            }
            Pattern::Charuco { .. } => {
                let (j, i) = grid(self.columns - 1);
                [(j + 1.0) * s, (i + 1.0) * s]
            }
            Pattern::Aprilgrid { marker_mm } => {
                let (tag, corner) = (index / 4, index % 4);
                let origin = [(tag % self.columns) as f64 * s, (tag / self.columns) as f64 * s];
                let offset = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]][corner];
                [origin[0] + *marker_mm * offset[0], origin[1] + *marker_mm * offset[1]]
            }
        }
    }

    /// Positions of all markers, in order, in the board frame, mm.
    pub fn points(&self) -> Vec<[f64; 2]> {
        (0..self.len()).map(|i| self.point(i)).collect()
    }

    /// Width and height, mm, of the rectangle from the board's origin that has the centre of the markers as its own: for dots and
    /// inner corners of a chessboard that of the markers, for ChArUco that of the squares.
    pub fn size_mm(&self) -> [f64; 2] {
        let [low, high] = self.marker_rectangle();
        [0, 1].map(|axis| low[axis] + high[axis])
    }

    /// Lowest and highest (x, y) of the markers, mm.
    pub fn marker_rectangle(&self) -> [[f64; 2]; 2] {
        let points = self.points();
        let corner = |pick: fn(f64, f64) -> f64, start: f64| {
            points.iter().fold([start; 2], |c, p| [pick(c[0], p[0]), pick(c[1], p[1])])
        };
        [corner(f64::min, f64::INFINITY), corner(f64::max, f64::NEG_INFINITY)]
    }

    /// Diameter of the printed dots in mm, where the board has dots and their diameter is known.
    pub fn circle_diameter_mm(&self) -> Option<f64> {
        match self.pattern {
            Pattern::AsymmetricCircles { circle_diameter_mm } | Pattern::SymmetricCircles { circle_diameter_mm } => {
                (circle_diameter_mm != 0.0).then_some(circle_diameter_mm)
            }
            _ => None,
        }
    }

    /// Whether the markers are dots.
    pub fn has_circles(&self) -> bool {
        matches!(self.pattern, Pattern::AsymmetricCircles { .. } | Pattern::SymmetricCircles { .. })
    }

    /// The board with dots of another diameter, in mm, or of an unknown one, 0. Boards without dots stay as they are.
    pub fn with_circle_diameter_mm(&self, diameter_mm: f64) -> Target {
        let mut target = self.clone();
        if let Pattern::AsymmetricCircles { circle_diameter_mm } | Pattern::SymmetricCircles { circle_diameter_mm } =
            &mut target.pattern
        {
            *circle_diameter_mm = diameter_mm;
        }
        target
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn asymmetric_rows_are_shifted_by_one_spacing() {
        let target = Target {
            pattern: Pattern::AsymmetricCircles { circle_diameter_mm: 10.0 },
            columns: 4,
            rows: 11,
            spacing_mm: 17.0,
        };
        assert_eq!(target.len(), 44);
        assert_eq!(target.point(0), [0.0, 0.0]);
        assert_eq!(target.point(4), [17.0, 17.0]);
        assert_eq!(target.point(9), [34.0, 34.0]);
    }

    #[test]
    fn an_unknown_diameter_can_be_set() {
        let pattern = Pattern::SymmetricCircles { circle_diameter_mm: 0.0 };
        let target = Target { pattern, columns: 4, rows: 5, spacing_mm: 20.0 };
        assert_eq!(target.circle_diameter_mm(), None);
        let known = target.with_circle_diameter_mm(12.0);
        assert_eq!(known.circle_diameter_mm(), Some(12.0));
    }

    #[test]
    fn several_boards_have_their_markers_one_after_the_other() {
        let april =
            |columns| Target { pattern: Pattern::Aprilgrid { marker_mm: 30.0 }, columns, rows: 1, spacing_mm: 39.0 };
        let numbered = |name: &str, first_tag, board| NumberedBoard { name: name.into(), first_tag, board };
        let both = Target::several(vec![numbered("a", 0, april(2)), numbered("b", 2, april(3))]);
        assert_eq!((both.len(), april(2).parts().len()), (20, 1));
        assert_eq!(both.point(9), april(3).point(1));
        let parts = both.parts();
        assert_eq!((parts[1].name, parts[1].first_tag, parts[1].markers.clone()), ("b", 2, 8..20));
        assert_eq!(both.points_of(1)[0], (8, [0.0, 0.0]));
        assert_eq!([0, 1].map(|i| parts[i].frame_name("0007")), ["0007", "0007+b"]);
        assert_eq!((parts[0].image_name("0007"), parts[1].image_name("0007+b")), ("0007", "0007"));
        let text = serde_json::to_string(&both).unwrap();
        assert_eq!(serde_json::from_str::<Target>(&text).unwrap(), both);
    }

    #[test]
    fn charuco_counts_squares_and_aprilgrid_counts_tags() {
        let charuco = Target {
            pattern: Pattern::Charuco { marker_mm: 15.0, dictionary: "DICT_5X5_100".into() },
            columns: 7,
            rows: 5,
            spacing_mm: 20.0,
        };
        assert_eq!(charuco.len(), 24);
        assert_eq!(charuco.point(0), [20.0, 20.0]);
        let april = Target { pattern: Pattern::Aprilgrid { marker_mm: 30.0 }, columns: 6, rows: 6, spacing_mm: 39.0 };
        assert_eq!(april.len(), 144);
        assert_eq!(april.point(6), [69.0, 30.0]);
    }

    /// Corners of every board at its ends, counted by hand.
    #[test]
    fn markers_are_where_boards_have_them() {
        let board = |pattern, columns, rows, spacing_mm| Target { pattern, columns, rows, spacing_mm };
        let april = board(Pattern::Aprilgrid { marker_mm: 30.0 }, 6, 2, 39.0);
        // The second tag of the second row, clockwise from its top left.
        let corners: Vec<[f64; 2]> = (28..32).map(|i| april.point(i)).collect();
        assert_eq!(corners, [[39.0, 39.0], [69.0, 39.0], [69.0, 69.0], [39.0, 69.0]]);
        assert_eq!(april.marker_rectangle(), [[0.0, 0.0], [225.0, 69.0]]);

        let chessboard = board(Pattern::Chessboard, 8, 6, 25.0);
        assert_eq!((chessboard.point(13), chessboard.size_mm()), ([125.0, 25.0], [175.0, 125.0]));
        assert!(
            !chessboard.has_circles() && !chessboard.is_empty() && board(Pattern::Chessboard, 0, 6, 25.0).is_empty()
        );

        // The rectangle of ChArUco's squares is centred on that of its corners.
        let charuco = board(Pattern::Charuco { marker_mm: 15.0, dictionary: "DICT_5X5_100".into() }, 7, 5, 20.0);
        assert_eq!(charuco.point(7), [40.0, 40.0]);
        assert_eq!((charuco.marker_rectangle(), charuco.size_mm()), ([[20.0, 20.0], [120.0, 80.0]], [140.0, 100.0]));

        let dots = board(Pattern::AsymmetricCircles { circle_diameter_mm: 10.0 }, 4, 11, 17.0);
        assert!(dots.has_circles());
        assert_eq!((dots.point(43), dots.marker_rectangle()), ([102.0, 170.0], [[0.0, 0.0], [119.0, 170.0]]));

        let numbered = |name: &str, board| NumberedBoard { name: name.into(), first_tag: 0, board };
        let both = Target::several(vec![numbered("a", april.clone()), numbered("b", charuco.clone())]);
        assert_eq!(both.point(48 + 7), charuco.point(7));
        assert_eq!((both.point(47), both.point(48)), (april.point(47), charuco.point(0)));
        assert!(both.point(48 + 24)[0].is_nan() && both.points_of(2).is_empty());
        assert_eq!(both.points_of(1).last(), Some(&(71, charuco.point(23))));
    }

    #[test]
    fn layouts_are_known_by_their_names() {
        for layout in [CharucoLayout::Current, CharucoLayout::Legacy] {
            assert_eq!(CharucoLayout::named(layout.name()), Some(layout));
        }
        assert_eq!(CharucoLayout::named("new"), None);
    }
}
