//! Faults of a declared board, in words.

use std::fmt;

use thiserror::Error;

/// One fault of a declared board.
#[derive(Debug, Clone, PartialEq)]
pub enum BoardFault {
    /// The images are mirrored.
    Mirrored,
    /// The board is of another kind.
    Kind {
        /// The kind.
        kind: &'static str,
        /// The evidence, in words.
        evidence: String,
    },
    /// It has other numbers of columns and rows.
    Size {
        /// Columns, as the kind of board counts them.
        columns: usize,
        /// Rows.
        rows: usize,
        /// The explanation, in words.
        explanation: &'static str,
    },
    /// Its tags are of another dictionary.
    Dictionary {
        /// The smallest dictionary that has them.
        dictionary: String,
    },
    /// Its tags have other numbers.
    FirstTag {
        /// The lowest number and the highest that were seen.
        seen: [usize; 2],
    },
    /// Its tags are of another size.
    MarkerSide {
        /// Side of a tag per spacing, as measured in the images.
        share: f64,
        /// Side of a tag with the declared spacing, mm.
        marker_mm: f64,
    },
}

impl fmt::Display for BoardFault {
    /// The fault and the line that mends it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Mirrored => write!(
                f,
                "the images are mirrored (their tags are legible in the mirrored image): mirror images and depth, or switch mirroring off \
                 where they are recorded"
            ),
            Self::Kind { kind, evidence } => write!(f, "{evidence}: kind = \"{kind}\""),
            Self::Size { columns, rows, explanation } => {
                write!(f, "the board has {columns} × {rows} ({explanation}): columns = {columns}, rows = {rows}")
            }
            Self::Dictionary { dictionary } => {
                write!(
                    f,
                    "the tags that were seen are of another dictionary: dictionary = \"{dictionary}\", or a larger one of the same cells"
                )
            }
            Self::FirstTag { seen: [low, high] } => {
                write!(f, "the tags that were seen have the numbers {low} to {high}: first_tag = {low}")
            }
            Self::MarkerSide { share, marker_mm } => write!(
                f,
                "the side of a tag measures {share:.3} of the spacing in the images: marker_mm = {marker_mm:.2} if spacing_mm is right"
            ),
        }
    }
}

/// The faults of a declared board, for which it was not found, with the lines that mend them.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("the board is not as declared under [board] in dataset.toml: {}; with that it was found in {found} of {tried} images that were tried",
    .faults.iter().map(BoardFault::to_string).collect::<Vec<_>>().join("; and "))]
pub struct BoardCause {
    /// The faults.
    pub faults: Vec<BoardFault>,
    /// Images in which the mended board was found.
    pub found: usize,
    /// Its markers in these.
    pub markers: usize,
    /// Images that were tried.
    pub tried: usize,
}
