//! `board`: boards to print.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use depthcal_io::{
    BoardPage, CameraSection, DatasetFile, Paper, StagedResults, board_pdf, board_svg, write_atomically,
};
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
        let extension = self.out.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
        if !["pdf", "svg"].contains(&extension.as_str()) {
            return Err(Failure::Input(format!(
                "{}: give --out a name that ends with .pdf or .svg",
                self.out.display()
            )));
        }
        let toml = section(&self.target())?;
        // As a dataset will read it: every limit of dataset.toml holds for a print too.
        let target = DatasetFile::parse(Path::new("the board"), &format!("{toml}\n[frames]\nimage = \"*\"\n"))
            .map_err(input)?
            .board;
        let dictionary = match &target.pattern {
            Pattern::Charuco { dictionary, .. } => dictionary.as_str(),
            _ => "DICT_APRILTAG_36h11",
        };
        let page = BoardPage::new(&target, self.paper, &|id| tag_cells(dictionary, id)).map_err(input)?;
        let bytes = if extension == "pdf" { board_pdf(&page) } else { board_svg(&page).into_bytes() };
        let beside = self.out.with_extension("toml");
        write_both([(&beside, toml.as_bytes()), (&self.out, &bytes)])?;
        let [width, height] = page.size_mm;
        say!("{toml}");
        say!(
            "{width} × {height} mm: print at 100 %, without fitting to the page; the ruler must measure {} mm, else multiply all lengths \
             by what it measures / {}",
            page.ruler_mm,
            page.ruler_mm
        );
        say!("written: {}, {}", self.out.display(), beside.display());
        Ok(json!({ "page_mm": page.size_mm, "ruler_mm": page.ruler_mm, "written": [self.out, beside] }))
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

/// Writes the section and the print, so that neither is ever beside that of another board.
fn write_both(files: [(&Path, &[u8]); 2]) -> Result<(), Failure> {
    let name = |path: &Path| path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let folder = files[0].0.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let staged = StagedResults::within(folder).map_err(input)?;
    for (path, bytes) in files {
        let path = staged.folder().join(name(path));
        write_atomically(path, |file| file.write_all(bytes)).map_err(|error| input(staged.located(error)))?;
    }
    staged.commit(&name(files[0].0)).map_err(input)?;
    Ok(())
}

/// The section `[board]`.
fn section(target: &Target) -> Result<String, Failure> {
    // Written as a file would be, of which only this section stays.
    let file = DatasetFile {
        board: target.clone(),
        metadata: None,
        associations: None,
        within_s: None,
        cameras: vec![CameraSection { image: Some("*".into()), ..CameraSection::default() }],
    };
    let text = file.to_toml().map_err(input)?;
    let end = text.find("\n[frames]").unwrap_or(text.len());
    Ok(text[..end].trim_end().to_owned() + "\n")
}

#[cfg(feature = "detect")]
fn tag_cells(dictionary: &str, id: usize) -> Result<Vec<Vec<bool>>, String> {
    depthcal_detect::tag_cells(dictionary, id).map_err(|error| error.to_string())
}

#[cfg(not(feature = "detect"))]
fn tag_cells(_: &str, _: usize) -> Result<Vec<Vec<bool>>, String> {
    Err("this program was built without OpenCV's dictionaries (feature 'detect')".into())
}
