//! Why markers of a file cannot be used.

use std::path::PathBuf;

use thiserror::Error;

/// Why markers of a file cannot be used for a dataset.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum GivenMarkersError {
    /// No image of the dataset is in the file.
    #[error("{}: none of its images is in {}: it names {example}; the file names must be those of the dataset's images", file.display(), root.display())]
    NoImage {
        /// The file.
        file: PathBuf,
        /// The dataset's folder.
        root: PathBuf,
        /// An image that the file names, or `no image`.
        example: String,
    },
    /// Two images of the file fit one of the dataset.
    #[error("{}: {first} (line {}) and {second} (line {}) may both be {}: write enough of the path to tell them apart", file.display(), lines[0], lines[1], image.display())]
    Ambiguous {
        /// The file.
        file: PathBuf,
        /// An image that the file names.
        first: String,
        /// Another.
        second: String,
        /// Their lines.
        lines: [usize; 2],
        /// The dataset's image.
        image: PathBuf,
    },
    /// The number of corners is not that of the board.
    #[error(
        "{}, line {line}: {image} has {got} corners, but the board has {need} ({rows} rows of {columns}): write one line per corner, row by \
         row, with `-` for corners that were not found",
        file.display()
    )]
    Count {
        /// The file.
        file: PathBuf,
        /// Line of the image's first corner.
        line: usize,
        /// The image, as the file names it.
        image: String,
        /// Corners of the image.
        got: usize,
        /// Markers of the board.
        need: usize,
        /// Markers in a row of the grid.
        columns: usize,
        /// Rows of the grid.
        rows: usize,
    },
    /// A corner outside the image.
    #[error("{}, line {line}: ({}, {}) is outside the image, {} × {} px", file.display(), pixel[0], pixel[1], size[0], size[1])]
    Outside {
        /// The file.
        file: PathBuf,
        /// Line of the corner.
        line: usize,
        /// The corner, px.
        pixel: [f64; 2],
        /// Width and height of the image, px.
        size: [usize; 2],
    },
    /// The corners are those of a board seen from behind.
    #[error(
        "{}, line {line}: the corners of {image} run as on a board seen from behind: rows run to the right and follow each other \
         downwards on the print; reverse each row, or exchange `columns` and `rows` in dataset.toml",
        file.display()
    )]
    Mirrored {
        /// The file.
        file: PathBuf,
        /// Line of the image's first corner.
        line: usize,
        /// The image, as the file names it.
        image: String,
    },
    /// The board's dots have no known size, which is measured where dots are detected.
    #[error("{}: with markers from a file the size of the dots is not measured: declare board.circle_diameter_mm", root.display())]
    Diameter {
        /// The dataset's folder.
        root: PathBuf,
    },
}
