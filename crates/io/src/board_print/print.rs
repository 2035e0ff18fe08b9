//! Files of a board to print: the page, and a file with the section `[board]` of a dataset.

use std::path::{Path, PathBuf};

use depthcal_model::{Pattern, Target};
use thiserror::Error;

use super::error::BoardPrintError;
use super::page::BoardPage;
use super::paper::Paper;
use super::pdf::board_pdf;
use super::svg::board_svg;
use crate::dataset::{CameraSection, DatasetError, DatasetFile};
use crate::file::{FileError, StagedResults, write_atomically};

/// Why a print is not in its files.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum BoardFileError {
    /// A name of another format.
    #[error("{}: give a name that ends with .pdf or .svg", path.display())]
    Format {
        /// The file.
        path: PathBuf,
    },
    /// A board that cannot be written as TOML.
    #[error("the board: {0}")]
    Toml(#[from] toml::ser::Error),
    /// A board that no dataset may have.
    #[error(transparent)]
    Board(#[from] DatasetError),
    /// The board does not fit on the paper, or cannot be drawn.
    #[error(transparent)]
    Print(#[from] BoardPrintError),
    /// A file cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
}

/// A print that was written.
#[derive(Debug, Clone, PartialEq)]
pub struct BoardFiles {
    /// Width and height of the page, mm.
    pub page_mm: [f64; 2],
    /// Length of the ruler, mm.
    pub ruler_mm: f64,
    /// The section `[board]`.
    pub section: String,
    /// The print, and the file of the section.
    pub written: [PathBuf; 2],
}

/// Draws a tag of a dictionary, by their names and numbers: rows of cells, or the reason why not.
pub type DictionaryCells<'a> = dyn Fn(&str, usize) -> Result<Vec<Vec<bool>>, String> + 'a;

/// Writes a board to print into `out`, a PDF or SVG by its name, and the section `[board]` of a dataset into a file of the same
/// name with the extension `.toml`. `cells` draws the tags of a dictionary by its name; without `paper` the smallest that holds
/// the board is taken.
///
/// # Errors
///
/// [`BoardFileError`]; neither file is then written.
pub fn write_board(
    target: &Target,
    paper: Option<Paper>,
    out: &Path,
    cells: &DictionaryCells<'_>,
) -> Result<BoardFiles, BoardFileError> {
    let extension = out.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    if !["pdf", "svg"].contains(&extension.as_str()) {
        return Err(BoardFileError::Format { path: out.to_owned() });
    }
    let section = section(target)?;
    // As a dataset will read it: every limit of dataset.toml holds for a print too.
    let text = format!("{section}\n[frames]\nimage = \"*\"\n");
    let target = DatasetFile::parse(Path::new("the board"), &text)?.board;
    let dictionary = match &target.pattern {
        Pattern::Charuco { dictionary, .. } => dictionary.as_str(),
        _ => "DICT_APRILTAG_36h11",
    };
    let page = BoardPage::new(&target, paper, &|id| cells(dictionary, id))?;
    let bytes = if extension == "pdf" { board_pdf(&page) } else { board_svg(&page).into_bytes() };
    let beside = out.with_extension("toml");
    write_both([(&beside, section.as_bytes()), (out, &bytes)])?;
    Ok(BoardFiles { page_mm: page.size_mm, ruler_mm: page.ruler_mm, section, written: [out.to_owned(), beside] })
}

/// Writes both files so that the section of one board never lies in one folder with the print of another.
fn write_both(files: [(&Path, &[u8]); 2]) -> Result<(), FileError> {
    let name = |path: &Path| path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let folder = files[0].0.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let staged = StagedResults::within(folder)?;
    for (path, bytes) in files {
        let path = staged.folder().join(name(path));
        write_atomically(path, |file| file.write_all(bytes)).map_err(|error| staged.located(error))?;
    }
    staged.commit(&name(files[0].0))?;
    Ok(())
}

/// The section `[board]`.
fn section(target: &Target) -> Result<String, toml::ser::Error> {
    // Written as a file would be, of which only this section stays.
    let file = DatasetFile {
        board: target.clone(),
        metadata: None,
        associations: None,
        within_s: None,
        cameras: vec![CameraSection { image: Some("*".into()), ..CameraSection::default() }],
    };
    let text = file.to_toml()?;
    let end = text.find("\n[frames]").unwrap_or(text.len());
    Ok(text[..end].trim_end().to_owned() + "\n")
}
