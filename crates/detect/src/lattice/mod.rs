//! Point lattices in an image, and the board's place in them. Shared by circle grids and chessboards.

pub(crate) mod blob;
pub(crate) mod labelling;
pub(crate) mod neighbourhood;
