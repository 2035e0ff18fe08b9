//! Boards to print: a page with the board to scale and a ruler, as SVG or PDF.

mod error;
mod page;
mod paper;
mod pdf;
mod print;
mod svg;

pub use error::BoardPrintError;
pub use page::{BoardPage, TagCells};
pub use paper::Paper;
pub use pdf::board_pdf;
pub use print::{BoardFileError, BoardFiles, DictionaryCells, write_board};
pub use svg::board_svg;
