//! Markers that another program found, in mrcal's format of corners.
//!
//! The format is a vnlog: a legend `# filename x y level`, then a line per corner, all corners of an image one after another, row
//! by row of the board. `-` stands for a value that there is not. mrcal and mrgingham write it; see mrcal's
//! `mrcal-calibrate-cameras`, `--corners-cache`.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Why a file of corners cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CornerFileError {
    /// The file cannot be read.
    #[error("cannot read {}: {error}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The operating system's error.
        error: std::io::Error,
    },
    /// A line is not as expected.
    #[error("{}, line {line}: {problem}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// The fault, and what is expected.
        problem: String,
    },
    /// A value is not as expected.
    #[error("{}, line {line}, column {column} ({field}): {problem}", path.display())]
    Value {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Column of the line's text, from 1.
        column: usize,
        /// Name in the legend.
        field: String,
        /// The fault, and what is expected.
        problem: String,
    },
}

/// A corner that was found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FileCorner {
    /// Position [u, v], px; pixel centres have integer coordinates.
    pub pixel: [f64; 2],
    /// Standard deviation relative to a corner of level 0 or weight 1: 2^level, or 1 / weight.
    pub relative_std: f64,
}

/// The corners of an image.
#[derive(Debug, Clone, PartialEq)]
pub struct ImageCorners {
    /// The image, as the file names it.
    pub image: String,
    /// Its lines, from 1: one per corner, or a single one that says that the board was not found.
    pub lines: Vec<usize>,
    /// The corners in the file's order, `None` for one that was not found. Empty where the board was not found.
    pub corners: Vec<Option<FileCorner>>,
}

/// Reads the corners of all images, in the file's order.
///
/// The legend names `filename`, `x` and `y`, and `level` or `weight` where these are known; further fields are ignored. A corner
/// counts as not found where x, y, level or weight is `-`, or level or weight is negative, or the weight 0.
///
/// # Errors
/// [`CornerFileError`], with line and column.
pub fn read_corners(path: &Path) -> Result<Vec<ImageCorners>, CornerFileError> {
    let text = fs::read_to_string(path).map_err(|error| CornerFileError::Read { path: path.to_owned(), error })?;
    let mut legend: Option<Legend> = None;
    let mut images: Vec<ImageCorners> = Vec::new();
    let mut first_lines: BTreeMap<String, usize> = BTreeMap::new();
    for (number, text) in text.trim_start_matches('\u{feff}').lines().enumerate() {
        let line = Line { path, number: number + 1, cells: cells(text) };
        let Some(first) = line.cells.first() else { continue };
        if let Some(comment) = first.1.strip_prefix('#') {
            // `##` and `#!` are comments, and so is what follows the legend.
            if legend.is_none() && !comment.starts_with(['#', '!']) {
                legend = Some(Legend::read(&line)?);
            }
            continue;
        }
        let Some(legend) = &legend else {
            return Err(line.wrong("a legend is missing: begin the file with `# filename x y level`".to_owned()));
        };
        let (image, corner) = legend.corner(&line)?;
        if let Some(last) = images.last_mut().filter(|last| last.image == image) {
            last.corners.push(corner);
            last.lines.push(line.number);
            continue;
        }
        if let Some(first) = first_lines.insert(image.clone(), line.number) {
            let problem = format!("line {first} is of {image} already: write all its corners one after another");
            return Err(line.wrong(problem));
        }
        images.push(ImageCorners { image, lines: vec![line.number], corners: vec![corner] });
    }
    // A single line without a corner says that the board was not found; no board has one marker.
    for image in &mut images {
        if image.corners == [None] {
            image.corners.clear();
        }
    }
    Ok(images)
}

/// A line's cells, each with the column at which it begins, from 1.
struct Line<'a> {
    path: &'a Path,
    number: usize,
    cells: Vec<(usize, &'a str)>,
}

impl Line<'_> {
    fn wrong(&self, problem: String) -> CornerFileError {
        CornerFileError::Line { path: self.path.to_owned(), line: self.number, problem }
    }

    fn wrong_value(&self, column: usize, field: &str, problem: String) -> CornerFileError {
        CornerFileError::Value {
            path: self.path.to_owned(),
            line: self.number,
            column,
            field: field.to_owned(),
            problem,
        }
    }
}

fn cells(text: &str) -> Vec<(usize, &str)> {
    let mut cells = Vec::new();
    let mut column = 1;
    let mut unread = text;
    while let Some(start) = unread.find(|c: char| !c.is_whitespace()) {
        column += unread[..start].chars().count();
        unread = &unread[start..];
        let end = unread.find(char::is_whitespace).unwrap_or(unread.len());
        cells.push((column, &unread[..end]));
        column += unread[..end].chars().count();
        unread = &unread[end..];
    }
    cells
}

/// Which cell is which field.
struct Legend {
    fields: usize,
    filename: usize,
    x: usize,
    y: usize,
    /// The cell, and whether it is a weight instead of a level.
    quality: Option<(usize, bool)>,
}

impl Legend {
    fn read(line: &Line) -> Result<Legend, CornerFileError> {
        let names: Vec<&str> =
            line.cells.iter().map(|(_, name)| name.trim_start_matches('#')).filter(|name| !name.is_empty()).collect();
        let column = |field: &str| names.iter().position(|name| *name == field);
        let need = |field: &str| {
            column(field).ok_or_else(|| {
                line.wrong(format!("the legend has no field `{field}`: write `# filename x y level`, as mrcal does"))
            })
        };
        let quality = column("level").map(|cell| (cell, false)).or_else(|| column("weight").map(|cell| (cell, true)));
        Ok(Legend { fields: names.len(), filename: need("filename")?, x: need("x")?, y: need("y")?, quality })
    }

    /// The image of a line, and its corner, `None` where it was not found.
    fn corner(&self, line: &Line) -> Result<(String, Option<FileCorner>), CornerFileError> {
        let cell = |index: usize| line.cells.get(index).map_or("-", |cell| cell.1);
        // Where there is no board, mrgingham leaves out the last fields.
        let no_board = [self.x, self.y].iter().all(|&index| cell(index) == "-");
        if line.cells.len() != self.fields && !(no_board && line.cells.len() < self.fields) {
            let (got, fields) = (line.cells.len(), self.fields);
            return Err(line.wrong(format!("this line has {got} entries, and the legend {fields}")));
        }
        let image = cell(self.filename).to_owned();
        let number = |index: usize, field: &str| -> Result<Option<f64>, CornerFileError> {
            let text = cell(index);
            if text == "-" {
                return Ok(None);
            }
            match text.parse::<f64>() {
                Ok(value) if value.is_finite() => Ok(Some(value)),
                _ => {
                    let problem = format!("`{text}` is no number: write one, or `-` for a corner that was not found");
                    Err(line.wrong_value(line.cells[index].0, field, problem))
                }
            }
        };
        let (x, y) = (number(self.x, "x")?, number(self.y, "y")?);
        let quality = match self.quality {
            Some((index, weight)) => {
                let field = if weight { "weight" } else { "level" };
                number(index, field)?.map(|value| if weight { 1.0 / value } else { value.exp2() }.copysign(value))
            }
            None => Some(1.0),
        };
        let usable = quality.filter(|std| *std > 0.0 && std.is_finite());
        Ok((image, x.zip(y).zip(usable).map(|((x, y), relative_std)| FileCorner { pixel: [x, y], relative_std })))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Vec<ImageCorners>, String> {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("corners.vnl");
        fs::write(&path, text).expect("written");
        read_corners(&path).map_err(|error| error.to_string())
    }

    #[test]
    fn boards_missing_boards_and_missing_corners() {
        let text = "## made by hand\n# filename x y level\na.png 1.5 2 0\na.png 3 4 1\na.png - - 2\na.png 5 6 -\n\
                    # a comment\nb.png - - -\nc.png - -\nd.png 7 8 -1\nd.png 7 8 0\ne.png - - -\ne.png - -\ne.png 1 2 0\n";
        let images = read(text).expect("valid");
        let names: Vec<&str> = images.iter().map(|i| i.image.as_str()).collect();
        assert_eq!(names, ["a.png", "b.png", "c.png", "d.png", "e.png"]);
        let corner = |pixel, relative_std| Some(FileCorner { pixel, relative_std });
        assert_eq!(images[0].corners, [corner([1.5, 2.0], 1.0), corner([3.0, 4.0], 2.0), None, None]);
        assert!(images[1].corners.is_empty() && images[2].corners.is_empty());
        assert_eq!(images[3].lines, [10, 11]);
        assert_eq!(images[3].corners, [None, corner([7.0, 8.0], 1.0)]);
        assert_eq!(images[4].corners, [None, None, corner([1.0, 2.0], 1.0)]);
    }

    #[test]
    fn weights_and_other_orders_of_fields() {
        let images = read("# x y filename weight\n1 2 a.png 0.5\n3 4 a.png 0\n").expect("valid");
        assert_eq!(images[0].corners, [Some(FileCorner { pixel: [1.0, 2.0], relative_std: 2.0 }), None]);
        let plain = read("# filename x y\na.png 1 2\n").expect("valid");
        assert_eq!(plain[0].corners[0].map(|c| c.relative_std), Some(1.0));
    }

    #[test]
    fn faults_have_their_line_and_column() {
        let fault = |text: &str| read(text).expect_err("a fault");
        let value = fault("# filename x y level\na.png 1 2 0\na.png  1x 2 0\n");
        assert!(value.contains("line 3, column 8 (x)") && value.contains("`1x`"), "{value}");
        assert!(fault("a.png 1 2 0\n").contains("line 1: a legend is missing"));
        assert!(fault("# filename x level\na.png 1 0\n").contains("no field `y`"));
        assert!(fault("# filename x y level\na.png 1 2\n").contains("3 entries, and the legend 4"));
        let twice = fault("# filename x y\na 1 2\nb 1 2\na 3 4\n");
        assert!(twice.contains("line 4: line 2 is of a already"), "{twice}");
    }
}
