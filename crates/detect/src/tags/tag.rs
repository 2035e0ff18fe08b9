//! A tag that was read, and how tags are read.

use super::dictionary::Dictionary;

/// A tag that was read: its number and its corners (px), clockwise from the tag's own top left.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Tag {
    pub(crate) id: usize,
    pub(crate) corners: [[f64; 2]; 4],
}

/// How tags are read.
pub(crate) struct Reading<'a> {
    /// The tags of the board.
    pub(crate) dictionary: &'a Dictionary,
    /// Width of a tag's black border in cells.
    pub(crate) border: usize,
    /// Enlargement of the image; the cells of small tags are resolved only when it is above 1.
    pub(crate) scale: usize,
}
