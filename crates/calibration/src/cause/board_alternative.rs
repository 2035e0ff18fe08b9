//! A board that the images may show instead of the declared one.

use depthcal_model::{NumberedBoard, Target};

use super::board_fault::BoardFault;

/// A board that the images may show instead, with the faults of the declaration, and whether the images are mirrored.
pub(super) struct Alternative {
    pub(super) target: Target,
    pub(super) is_mirrored: bool,
    pub(super) faults: Vec<BoardFault>,
}

/// A board of tags from `first_tag` on.
pub(super) fn numbered(board: Target, first_tag: usize) -> Target {
    match first_tag {
        0 => board,
        _ => Target::several(vec![NumberedBoard { name: "board".to_owned(), first_tag, board }]),
    }
}
