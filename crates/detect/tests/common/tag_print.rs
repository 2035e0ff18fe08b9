//! The print of boards with tags: which points of the board are black.

use depthcal_detect::tag_cells;
use depthcal_model::target::{Pattern, Target};

/// Ways in which boards with tags are printed.
#[derive(Clone, Copy, Default)]
pub struct Style {
    /// ChArUco: the square at the top left is white where the number of rows is even, as drawn by OpenCV before 4.6.
    pub legacy: bool,
    /// AprilGrid: black squares between the corners of the tags, and borders of two cells, as Kalibr draws it.
    pub kalibr: bool,
    /// Number of the first tag in its dictionary.
    pub first_tag: usize,
}

/// Tags and squares of a board.
pub struct TagPrint {
    target: Target,
    style: Style,
    side: f64,
    /// Cells of every tag with its border, whether they are white.
    tags: Vec<Vec<Vec<bool>>>,
}

impl TagPrint {
    /// # Panics
    /// When the board has no tags.
    pub fn new(target: &Target, style: Style) -> TagPrint {
        let (side, name, count) = match &target.pattern {
            Pattern::Charuco { marker_mm, dictionary } => {
                (*marker_mm, dictionary.as_str(), (target.columns * target.rows).div_ceil(2))
            }
            Pattern::Aprilgrid { marker_mm } => (*marker_mm, "DICT_APRILTAG_36h11", target.columns * target.rows),
            _ => panic!("a board without tags"),
        };
        let ids = style.first_tag..style.first_tag + count;
        let tags = ids.map(|id| with_border(tag_cells(name, id).expect("a tag"), style.kalibr)).collect();
        TagPrint { target: target.clone(), style, side, tags }
    }

    /// Whether the point (mm) is black.
    pub fn is_black(&self, x: f64, y: f64) -> bool {
        let pitch = self.target.spacing_mm;
        let (j, i) = ((x / pitch).floor() as i64, (y / pitch).floor() as i64);
        let (columns, rows) = (self.target.columns as i64, self.target.rows as i64);
        let (u, v) = (x - j as f64 * pitch, y - i as f64 * pitch);
        match self.target.pattern {
            Pattern::Charuco { .. } => {
                if !(0..columns).contains(&j) || !(0..rows).contains(&i) {
                    return false;
                }
                let first_white = i64::from(!(self.style.legacy && rows % 2 == 0));
                if (i + j + first_white) % 2 != 0 {
                    return true;
                }
                let before: i64 = (0..i).map(|row| (columns - (row + first_white) % 2 + 1) / 2).sum();
                let id = before + j / 2;
                let margin = (pitch - self.side) / 2.0;
                self.tag(id as usize, u - margin, v - margin)
            }
            _ => {
                // Gaps before the first tag belong to the column −1.
                if (0..columns).contains(&j) && (0..rows).contains(&i) && u <= self.side && v <= self.side {
                    return self.tag((i * columns + j) as usize, u, v);
                }
                let corner = (-1..columns).contains(&j) && (-1..rows).contains(&i) && u >= self.side && v >= self.side;
                self.style.kalibr && corner
            }
        }
    }

    fn tag(&self, id: usize, u: f64, v: f64) -> bool {
        let cells = &self.tags[id];
        let n = cells.len() as f64;
        let (column, row) = ((u / self.side * n).floor(), (v / self.side * n).floor());
        let inside = (0.0..n).contains(&column) && (0.0..n).contains(&row);
        inside && !cells[row as usize][column as usize]
    }
}

/// Cells with a border of two cells instead of one.
fn with_border(cells: Vec<Vec<bool>>, wide: bool) -> Vec<Vec<bool>> {
    if !wide {
        return cells;
    }
    let n = cells.len() + 2;
    let line = |cells: Vec<bool>| [vec![false], cells, vec![false]].concat();
    let mut rows = vec![vec![false; n]];
    rows.extend(cells.into_iter().map(line));
    rows.push(vec![false; n]);
    rows
}
