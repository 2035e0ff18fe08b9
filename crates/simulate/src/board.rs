//! The board: its print and its reflectance in the infrared.

use serde::{Deserialize, Serialize};

/// The printed pattern.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Pattern {
    /// Dots whose odd rows are shifted by one spacing: dot (row i, column j) at ((2 j + i mod 2) s, i s).
    AsymmetricCircles {
        /// Diameter of a dot, mm.
        circle_diameter_mm: f64,
    },
    /// Dots on a square grid: (j s, i s).
    SymmetricCircles {
        /// Diameter of a dot, mm.
        circle_diameter_mm: f64,
    },
    /// A chessboard; the markers are its inner corners (j s, i s).
    Chessboard,
}

/// A board. Its frame has its origin in the first marker, x along the rows, y along the columns, and z away from a
/// viewer of the print, mm.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Board {
    /// The printed pattern.
    pub pattern: Pattern,
    /// Markers in a row.
    pub columns: usize,
    /// Rows.
    pub rows: usize,
    /// Grid spacing, mm; for asymmetric circles the distance between neighbouring rows.
    pub spacing_mm: f64,
    /// White print on a black card instead of dark print on a white one.
    pub white_on_black: bool,
    /// Width of the card beyond the print on every side, mm.
    pub card_margin_mm: f64,
    /// Reflectance of bright areas in the infrared, from 0 to 1.
    pub bright: f64,
    /// Reflectance of dark areas in the infrared, from 0 to 1.
    pub dark: f64,
}

impl Default for Board {
    /// The thesis' board: asymmetric circles, 4 columns × 11 rows, spacing 17 mm, dots of 11.5 mm, dark on white.
    fn default() -> Self {
        Self::new(Pattern::AsymmetricCircles { circle_diameter_mm: 11.5 }, 4, 11, 17.0)
    }
}

impl Board {
    /// A dark-on-white board whose card extends by 1.25 spacings beyond the print.
    pub fn new(pattern: Pattern, columns: usize, rows: usize, spacing_mm: f64) -> Self {
        Self {
            pattern,
            columns,
            rows,
            spacing_mm,
            white_on_black: false,
            card_margin_mm: 1.25 * spacing_mm,
            bright: 0.8,
            dark: 0.08,
        }
    }

    /// Prints the board white on black.
    pub fn white_on_black(mut self) -> Self {
        self.white_on_black = true;
        self
    }

    /// Number of markers.
    pub fn len(&self) -> usize {
        self.columns * self.rows
    }

    /// Whether the board has no markers.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Position of marker `index` (row-major) as designed, mm.
    pub fn marker(&self, index: usize) -> [f64; 2] {
        let (i, j) = ((index / self.columns) as f64, (index % self.columns) as f64);
        let s = self.spacing_mm;
        match self.pattern {
            Pattern::AsymmetricCircles { .. } => [(2.0 * j + i % 2.0) * s, i * s],
            Pattern::SymmetricCircles { .. } | Pattern::Chessboard => [j * s, i * s],
        }
    }

    /// Diameter of the dots, mm; `None` for a chessboard.
    pub fn circle_diameter_mm(&self) -> Option<f64> {
        match self.pattern {
            Pattern::AsymmetricCircles { circle_diameter_mm } | Pattern::SymmetricCircles { circle_diameter_mm } => {
                Some(circle_diameter_mm)
            }
            Pattern::Chessboard => None,
        }
    }

    /// Rectangle [x0, y0, x1, y1] of the marker positions, mm.
    pub fn marker_rectangle(&self) -> [f64; 4] {
        let s = self.spacing_mm;
        let (columns, rows) = (self.columns as f64, self.rows as f64);
        let x1 = match self.pattern {
            Pattern::AsymmetricCircles { .. } => (2.0 * columns - if self.rows > 1 { 1.0 } else { 2.0 }) * s,
            Pattern::SymmetricCircles { .. } | Pattern::Chessboard => (columns - 1.0) * s,
        };
        [0.0, 0.0, x1, (rows - 1.0) * s]
    }

    /// Rectangle [x0, y0, x1, y1] of the print, mm, including whole dots or the outer squares.
    pub fn print_rectangle(&self) -> [f64; 4] {
        let grow = self.circle_diameter_mm().map_or(self.spacing_mm, |d| d / 2.0);
        grown(self.marker_rectangle(), grow)
    }

    /// Rectangle [x0, y0, x1, y1] of the card, mm.
    pub fn card_rectangle(&self) -> [f64; 4] {
        grown(self.print_rectangle(), self.card_margin_mm)
    }

    /// Middle of the markers, mm.
    pub fn centre(&self) -> [f64; 2] {
        let [x0, y0, x1, y1] = self.marker_rectangle();
        [(x0 + x1) / 2.0, (y0 + y1) / 2.0]
    }

    /// Whether (x, y) in mm lies on the card.
    pub(crate) fn on_card(&self, [x, y]: [f64; 2]) -> bool {
        let [x0, y0, x1, y1] = self.card_rectangle();
        x >= x0 && x <= x1 && y >= y0 && y <= y1
    }

    /// The card's surface at (x, y), mm: reflectance, and distances to the nearest edges of print and card. The point
    /// must lie on the card.
    pub(crate) fn surface(&self, p: [f64; 2]) -> Surface {
        let [x0, y0, x1, y1] = self.card_rectangle();
        let border = (p[0] - x0).min(x1 - p[0]).min(p[1] - y0).min(y1 - p[1]);
        let (printed, edge) = match self.circle_diameter_mm() {
            Some(diameter) => {
                let outside = self.nearest_dot(p) - diameter / 2.0;
                (outside < 0.0, outside.abs())
            }
            None => self.square(p),
        };
        let albedo = if printed != self.white_on_black { self.dark } else { self.bright };
        Surface { albedo, printed, print_edge_mm: edge, card_edge_mm: border }
    }

    /// Distance to the centre of the nearest dot, mm.
    fn nearest_dot(&self, [x, y]: [f64; 2]) -> f64 {
        let s = self.spacing_mm;
        let last_row = self.rows.saturating_sub(1) as f64;
        let last_column = self.columns.saturating_sub(1) as f64;
        let below = (y / s).floor().clamp(0.0, last_row);
        let mut nearest = f64::INFINITY;
        for row in [below, (below + 1.0).min(last_row)] {
            let (pitch, shift) = match self.pattern {
                Pattern::AsymmetricCircles { .. } => (2.0 * s, (row % 2.0) * s),
                _ => (s, 0.0),
            };
            let column = ((x - shift) / pitch).round().clamp(0.0, last_column);
            nearest = nearest.min((x - shift - column * pitch).hypot(y - row * s));
        }
        nearest
    }

    /// Whether a chessboard is dark at this point, and the distance to the nearest edge of a square, mm.
    fn square(&self, [x, y]: [f64; 2]) -> (bool, f64) {
        let s = self.spacing_mm;
        let [x0, y0, x1, y1] = self.print_rectangle();
        let inside = x >= x0 && x < x1 && y >= y0 && y < y1;
        let to_line = |a: f64| (a - (a / s).round() * s).abs();
        if inside {
            let dark = ((x - x0) / s).floor() as i64 + ((y - y0) / s).floor() as i64;
            (dark % 2 == 0, to_line(x).min(to_line(y)))
        } else {
            let outside = (x0 - x).max(x - x1).max(y0 - y).max(y - y1);
            (false, outside.max(0.0))
        }
    }
}

/// The card's surface at a point.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Surface {
    /// Reflectance, from 0 to 1.
    pub albedo: f64,
    /// Whether the point is on a dot or a dark square.
    pub printed: bool,
    /// Distance to the nearest edge of the print, mm.
    pub print_edge_mm: f64,
    /// Distance to the card's border, mm.
    pub card_edge_mm: f64,
}

fn grown([x0, y0, x1, y1]: [f64; 4], by: f64) -> [f64; 4] {
    [x0 - by, y0 - by, x1 + by, y1 + by]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markers_of_the_thesis_board() {
        let board = Board::default();
        assert_eq!(board.len(), 44);
        assert_eq!(board.marker(4), [17.0, 17.0]);
        assert_eq!(board.marker_rectangle(), [0.0, 0.0, 119.0, 170.0]);
        let last = (0..44).map(|i| board.marker(i)[0]).fold(0.0, f64::max);
        assert_eq!(last, 119.0);
    }

    #[test]
    fn dots_are_dark_within_their_radius_only() {
        let board = Board::default();
        for index in 0..board.len() {
            let [x, y] = board.marker(index);
            assert_eq!(board.surface([x + 5.7, y]).albedo, board.dark);
            assert_eq!(board.surface([x, y - 5.8]).albedo, board.bright);
            assert!((board.surface([x, y]).print_edge_mm - 5.75).abs() < 1e-12);
            assert_eq!(board.white_on_black().surface([x, y]).albedo, board.bright);
        }
    }

    #[test]
    fn chessboard_corners_lie_between_four_squares() {
        let board = Board::new(Pattern::Chessboard, 9, 6, 25.0);
        for index in 0..board.len() {
            let [x, y] = board.marker(index);
            let printed = |dx: f64, dy: f64| board.surface([x + dx, y + dy]).printed;
            assert_eq!(printed(-1.0, -1.0), printed(1.0, 1.0));
            assert_ne!(printed(-1.0, 1.0), printed(1.0, 1.0));
        }
        assert!(board.surface([-1.0, -1.0]).printed);
        assert!(!board.surface([-26.0, -1.0]).printed);
    }
}
