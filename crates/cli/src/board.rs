//! `board`: boards to print.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use depthcal_io::{BoardFiles, Paper, write_board};
use depthcal_model::{Pattern, Target};
use serde_json::{Value, json};

use super::failure::{Failure, input};
use super::voice::say;

/// Kinds of boards, as `board.kind` in dataset.toml names them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Kind {
    AsymmetricCircles,
    SymmetricCircles,
    Chessboard,
    Charuco,
    Aprilgrid,
}

/// Writes a board to print, to scale, with a ruler that checks the printer.
///
/// The section [board] for a dataset.toml is written to a second file of the same name, with the extension .toml. Print at 100 %,
/// measure the ruler, and glue the sheet onto something stiff and flat.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  depthcal board --kind asymmetric-circles --out board.pdf
  depthcal board --kind charuco --columns 9 --rows 6 --spacing-mm 24 --out board.pdf
  depthcal board --kind aprilgrid --columns 6 --rows 6 --spacing-mm 88 --marker-mm 66 --paper a1 --out board.svg")]
pub(super) struct Board {
    /// Kind of the board.
    #[arg(long, value_enum)]
    kind: Kind,
    /// Markers in a row: dots, inner corners of a chessboard, squares of ChArUco, tags [default: by kind].
    #[arg(long, value_name = "N")]
    columns: Option<usize>,
    /// Rows [default: by kind].
    #[arg(long, value_name = "N")]
    rows: Option<usize>,
    /// Spacing in mm, as board.spacing_mm [default: by kind].
    #[arg(long, value_name = "MM")]
    spacing_mm: Option<f64>,
    /// Diameter of the dots in mm [default: 0.65 of the spacing, 0.5 for symmetric circles].
    #[arg(long, value_name = "MM")]
    circle_diameter_mm: Option<f64>,
    /// Side of a tag in mm [default: 0.75 of the spacing].
    #[arg(long, value_name = "MM")]
    marker_mm: Option<f64>,
    /// OpenCV's name of the dictionary of a ChArUco board.
    #[arg(long, value_name = "NAME", default_value = "DICT_5X5_250")]
    dictionary: String,
    /// Paper: a0 … a5, letter, legal, tabloid, or width x height in mm [default: the smallest of A4 … A0 that holds the board].
    #[arg(long, value_name = "SIZE")]
    paper: Option<Paper>,
    /// File to write: .pdf or .svg.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

impl Board {
    pub(super) fn run(&self) -> Result<Value, Failure> {
        let BoardFiles { page_mm, ruler_mm, section, written } =
            write_board(&self.target(), self.paper, &self.out, &tag_cells).map_err(input)?;
        let [width, height] = page_mm;
        say!("{section}");
        say!(
            "{width} × {height} mm: print at 100 %, without fitting to the page; the ruler must measure {ruler_mm} mm, else multiply all \
             lengths by what it measures / {ruler_mm}"
        );
        let [print, beside] = written.each_ref().map(|path| path.display());
        say!("written: {print}, {beside}");
        Ok(json!({ "page_mm": page_mm, "ruler_mm": ruler_mm, "written": written }))
    }

    /// The board, with defaults that fit on A4 as on Letter.
    fn target(&self) -> Target {
        let (columns, rows, spacing) = match self.kind {
            Kind::AsymmetricCircles => (4, 11, 17.0),
            Kind::SymmetricCircles => (9, 7, 20.0),
            Kind::Chessboard => (8, 5, 25.0),
            Kind::Charuco => (9, 6, 25.0),
            Kind::Aprilgrid => (6, 4, 40.0),
        };
        let spacing_mm = self.spacing_mm.unwrap_or(spacing);
        let rounded = |share: f64| (share * spacing_mm * 10.0).round() / 10.0;
        let marker_mm = self.marker_mm.unwrap_or_else(|| rounded(0.75));
        let circle = |share: f64| self.circle_diameter_mm.unwrap_or_else(|| rounded(share));
        let pattern = match self.kind {
            Kind::AsymmetricCircles => Pattern::AsymmetricCircles { circle_diameter_mm: circle(0.65) },
            Kind::SymmetricCircles => Pattern::SymmetricCircles { circle_diameter_mm: circle(0.5) },
            Kind::Chessboard => Pattern::Chessboard,
            Kind::Charuco => Pattern::Charuco { marker_mm, dictionary: self.dictionary.clone() },
            Kind::Aprilgrid => Pattern::Aprilgrid { marker_mm },
        };
        Target { pattern, columns: self.columns.unwrap_or(columns), rows: self.rows.unwrap_or(rows), spacing_mm }
    }
}

#[cfg(feature = "detect")]
fn tag_cells(dictionary: &str, id: usize) -> Result<Vec<Vec<bool>>, String> {
    depthcal_detect::tag_cells(dictionary, id).map_err(|error| error.to_string())
}

#[cfg(not(feature = "detect"))]
fn tag_cells(_: &str, _: usize) -> Result<Vec<Vec<bool>>, String> {
    Err("this program was built without OpenCV's dictionaries (feature 'detect')".into())
}
