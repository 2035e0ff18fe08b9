//! Why a board cannot be printed.

/// Why a board cannot be printed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BoardPrintError {
    /// The board is larger than the paper.
    #[error(
        "the board needs {} × {} mm with its margins and the ruler, but the paper has {} × {} mm: choose larger paper, fewer markers or a \
         smaller spacing",
        .needs_mm[0], .needs_mm[1], .paper_mm[0], .paper_mm[1]
    )]
    TooLarge {
        /// Width and height that are needed, mm.
        needs_mm: [f64; 2],
        /// Width and height of the paper, mm.
        paper_mm: [f64; 2],
    },
    /// Dots without a diameter.
    #[error("the diameter of the dots is not known: give it in mm, about half of the distance of neighbouring dots")]
    NoDiameter,
    /// Several boards, which are printed one by one.
    #[error("several boards are printed one after the other: give one of them")]
    Several,
    /// A paper that is none.
    #[error("{name:?} is no paper size: give a0 … a5, letter, legal, tabloid, or width x height in mm such as 600x400")]
    UnknownPaper {
        /// The name that was given.
        name: String,
    },
    /// The dictionary gave no image of a tag.
    #[error("tag {id} cannot be drawn: {message}")]
    Tag {
        /// Number of the tag.
        id: usize,
        /// Why.
        message: String,
    },
}
