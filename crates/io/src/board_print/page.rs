//! The page: what is printed where, in mm from its top left corner.

use depthcal_model::{Pattern, Target};

use super::error::BoardPrintError;
use super::paper::Paper;

/// Gives the cells of a tag, row by row, with its black border of one cell: whether each is white; or why it cannot.
pub type TagCells<'a> = dyn Fn(usize) -> Result<Vec<Vec<bool>>, String> + 'a;

/// Left edge, top edge, width and height, mm.
pub(crate) type Rectangle = [f64; 4];

/// A line of text.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Text {
    /// Left end of the base line, mm.
    pub at: [f64; 2],
    /// Height of the letters, mm.
    pub size_mm: f64,
    pub text: String,
}

/// A board on a page, with a ruler of 100 mm (or less where there is less room) below it. Everything is black on white.
#[derive(Debug, Clone, PartialEq)]
pub struct BoardPage {
    /// Width and height of the page, mm.
    pub size_mm: [f64; 2],
    /// The origin of the board's frame (its first marker, or the corner from which its markers count) on the page, mm.
    pub origin_mm: [f64; 2],
    /// Length of the ruler, mm.
    pub ruler_mm: f64,
    pub(crate) black: Vec<Rectangle>,
    /// Centre and diameter of dots, mm.
    pub(crate) dots: Vec<[f64; 3]>,
    pub(crate) ruler: Vec<Rectangle>,
    pub(crate) text: Vec<Text>,
}

/// White around the board, mm, that every detector needs and most printers leave anyway.
const MARGIN_MM: f64 = 12.0;
/// Height of ruler and text below the board, mm.
const FOOT_MM: f64 = 20.0;
/// Height of letters, mm.
const LETTER_MM: f64 = 3.0;

impl BoardPage {
    /// Places a board on `paper`, or on the smallest of A4 … A0 that holds it. `tags` is asked for the tags of boards that have
    /// any.
    ///
    /// # Errors
    /// [`BoardPrintError`]: the paper is too small, the diameter of the dots is not known, or a tag cannot be drawn.
    pub fn new(target: &Target, paper: Option<Paper>, tags: &TagCells<'_>) -> Result<Self, BoardPrintError> {
        let [x0, y0, x1, y1] = extent(target)?;
        // Squares and dots at the border need white around them; half a spacing is what detectors expect.
        let margin = MARGIN_MM.max(0.5 * target.spacing_mm);
        let needs_mm = [(x1 - x0) + 2.0 * margin, (y1 - y0) + 2.0 * margin + FOOT_MM].map(|side| side.max(60.0));
        let paper = paper.map_or_else(|| Paper::fitting(needs_mm), |paper| paper.turned_for(needs_mm));
        let size_mm = paper.size_mm;
        if needs_mm[0] > size_mm[0] || needs_mm[1] > size_mm[1] {
            return Err(BoardPrintError::TooLarge { needs_mm, paper_mm: size_mm });
        }
        let origin_mm = [0.5 * (size_mm[0] - (x1 - x0)) - x0, 0.5 * (size_mm[1] - FOOT_MM - (y1 - y0)) - y0];
        let on_page = |[x, y, w, h]: Rectangle| [x + origin_mm[0], y + origin_mm[1], w, h];
        let black = rectangles(target, tags)?.into_iter().map(on_page).collect();
        let diameter = target.circle_diameter_mm().unwrap_or(0.0);
        let dots = if target.has_circles() { target.points() } else { Vec::new() };
        let dots = dots.into_iter().map(|[x, y]| [x + origin_mm[0], y + origin_mm[1], diameter]).collect();

        let room = size_mm[0] - 2.0 * MARGIN_MM;
        let ruler_mm = if room >= 100.0 { 100.0 } else { (room / 10.0).floor() * 10.0 };
        let left = MARGIN_MM;
        let base = size_mm[1] - 11.0;
        let ticks = (0..=ruler_mm as usize / 10).map(|i| {
            let long = if i % 5 == 0 { 4.0 } else { 2.5 };
            [left + 10.0 * i as f64 - 0.1, base - long, 0.2, long]
        });
        // The outer ticks' outer edges are the ruler's ends.
        let line = [left - 0.1, base - 0.1, ruler_mm + 0.2, 0.2];
        let text = |corner: [f64; 2], text: String| Text { at: corner, size_mm: LETTER_MM, text };
        let check = format!(
            "{ruler_mm} mm from the middle of the first line to that of the last. If not, the printer scaled the page: print at 100 %."
        );
        Ok(BoardPage {
            size_mm,
            origin_mm,
            ruler_mm,
            black,
            dots,
            ruler: ticks.chain([line]).collect(),
            text: vec![text([left, base + 4.0], check), text([left, base + 8.0], describe(target))],
        })
    }
}

impl BoardPage {
    /// Font size of a text, mm, made smaller where it would leave the page.
    pub(crate) fn font_size(&self, text: &Text) -> f64 {
        // Letters are some 0.72 of a font's size high, and some 0.5 wide on average.
        let size = text.size_mm / 0.72;
        let room = self.size_mm[0] - text.at[0] - 6.0;
        size.min(room / (0.5 * text.text.chars().count().max(1) as f64))
    }
}

/// The line below the board for its reader: the section `[board]`.
fn describe(target: &Target) -> String {
    let Target { columns, rows, spacing_mm, pattern } = target;
    let (kind, more) = match pattern {
        Pattern::AsymmetricCircles { circle_diameter_mm } => {
            ("asymmetric-circles", format!(", circle_diameter_mm = {circle_diameter_mm}"))
        }
        Pattern::SymmetricCircles { circle_diameter_mm } => {
            ("symmetric-circles", format!(", circle_diameter_mm = {circle_diameter_mm}"))
        }
        Pattern::Chessboard => ("chessboard", String::new()),
        Pattern::Charuco { marker_mm, dictionary } => {
            ("charuco", format!(", marker_mm = {marker_mm}, dictionary = \"{dictionary}\""))
        }
        Pattern::Aprilgrid { marker_mm } => ("aprilgrid", format!(", marker_mm = {marker_mm}")),
        Pattern::Several { .. } => ("several", String::new()),
    };
    format!("kind = \"{kind}\", columns = {columns}, rows = {rows}, spacing_mm = {spacing_mm}{more}")
}

/// Left, top, right and bottom edge of the print in the board's frame, mm.
fn extent(target: &Target) -> Result<[f64; 4], BoardPrintError> {
    let [[x0, y0], [x1, y1]] = target.marker_rectangle();
    let (columns, rows, s) = (target.columns as f64, target.rows as f64, target.spacing_mm);
    Ok(match &target.pattern {
        Pattern::AsymmetricCircles { .. } | Pattern::SymmetricCircles { .. } => {
            let r = target.circle_diameter_mm().ok_or(BoardPrintError::NoDiameter)? / 2.0;
            [x0 - r, y0 - r, x1 + r, y1 + r]
        }
        Pattern::Chessboard => [-s, -s, columns * s, rows * s],
        Pattern::Charuco { .. } => [0.0, 0.0, columns * s, rows * s],
        Pattern::Aprilgrid { .. } => [x0, y0, x1, y1],
        Pattern::Several { .. } => return Err(BoardPrintError::Several),
    })
}

/// Black rectangles in the board's frame, mm.
fn rectangles(target: &Target, tags: &TagCells<'_>) -> Result<Vec<Rectangle>, BoardPrintError> {
    let s = target.spacing_mm;
    // Black squares where column and row have an even sum, so that the top left one is black, as OpenCV draws boards since 4.6.
    let squares = |columns: usize, rows: usize, shift: f64| {
        let cells = (0..rows).flat_map(move |row| (0..columns).map(move |column| (row, column)));
        cells
            .filter(|(row, column)| (row + column) % 2 == 0)
            .map(|(row, column)| [column as f64 * s + shift, row as f64 * s + shift, s, s])
            .collect::<Vec<_>>()
    };
    match &target.pattern {
        Pattern::AsymmetricCircles { .. } | Pattern::SymmetricCircles { .. } => Ok(Vec::new()),
        Pattern::Chessboard => Ok(squares(target.columns + 1, target.rows + 1, -s)),
        Pattern::Charuco { marker_mm, .. } => {
            let mut all = squares(target.columns, target.rows, 0.0);
            let margin = (s - marker_mm) / 2.0;
            // Tags are numbered row by row over the white squares.
            let cells = (0..target.rows).flat_map(|row| (0..target.columns).map(move |column| (row, column)));
            for (id, (row, column)) in cells.filter(|(row, column)| (row + column) % 2 == 1).enumerate() {
                let corner = [column as f64 * s + margin, row as f64 * s + margin];
                all.extend(tag(id, corner, *marker_mm, tags)?);
            }
            Ok(all)
        }
        Pattern::Several { .. } => Err(BoardPrintError::Several),
        Pattern::Aprilgrid { marker_mm } => {
            let mut all = Vec::new();
            for id in 0..target.columns * target.rows {
                all.extend(tag(id, target.point(4 * id), *marker_mm, tags)?);
            }
            Ok(all)
        }
    }
}

/// The black cells of a tag, neighbours in a row together.
fn tag(id: usize, [x, y]: [f64; 2], side: f64, tags: &TagCells<'_>) -> Result<Vec<Rectangle>, BoardPrintError> {
    let cells = tags(id).map_err(|message| BoardPrintError::Tag { id, message })?;
    let cell = side / cells.len().max(1) as f64;
    let mut black = Vec::new();
    for (row, cells) in cells.iter().enumerate() {
        let mut column = 0;
        while column < cells.len() {
            let run = cells[column..].iter().take_while(|white| !**white).count();
            if run > 0 {
                black.push([x + column as f64 * cell, y + row as f64 * cell, run as f64 * cell, cell]);
            }
            column += run.max(1);
        }
    }
    Ok(black)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn no_tags(_: usize) -> Result<Vec<Vec<bool>>, String> {
        Err("no tags here".into())
    }

    #[test]
    fn a_chessboard_has_its_squares_to_scale() {
        let target = Target { pattern: Pattern::Chessboard, columns: 8, rows: 5, spacing_mm: 25.0 };
        let page = BoardPage::new(&target, None, &no_tags).unwrap();
        assert_eq!(page.size_mm, [297.0, 210.0]);
        assert_eq!(page.black.len(), 27);
        // The first corner lies between the squares (0, 0) and (1, 1), both black.
        let [x, y] = page.origin_mm;
        assert_eq!(page.black[0], [x - 25.0, y - 25.0, 25.0, 25.0]);
        assert!(page.black.contains(&[x, y, 25.0, 25.0]));
        assert!(page.text[1].text.contains("spacing_mm = 25"));
        assert_eq!(page.ruler_mm, 100.0);
    }

    #[test]
    fn tags_are_cells() {
        let target = Target { pattern: Pattern::Aprilgrid { marker_mm: 20.0 }, columns: 2, rows: 1, spacing_mm: 26.0 };
        let cells = |_| {
            Ok(vec![vec![false, false, false, false], vec![false, true, false, false], vec![true; 4], vec![false; 4]])
        };
        let page = BoardPage::new(&target, None, &cells).unwrap();
        let [x, y] = page.origin_mm;
        assert_eq!(page.black[..3], [[x, y, 20.0, 5.0], [x, y + 5.0, 5.0, 5.0], [x + 10.0, y + 5.0, 10.0, 5.0]]);
        assert_eq!(page.black.len(), 8);
        assert!(BoardPage::new(&target, None, &no_tags).unwrap_err().to_string().contains("no tags here"));
    }

    #[test]
    fn what_does_not_fit_is_said() {
        let target = Target { pattern: Pattern::Chessboard, columns: 8, rows: 5, spacing_mm: 60.0 };
        let message = BoardPage::new(&target, "a4".parse().ok(), &no_tags).unwrap_err().to_string();
        assert!(message.contains("600") && message.contains("210"), "{message}");
        let dots = Target { pattern: Pattern::SymmetricCircles { circle_diameter_mm: 0.0 }, ..target };
        assert!(matches!(BoardPage::new(&dots, None, &no_tags), Err(BoardPrintError::NoDiameter)));
    }
}
