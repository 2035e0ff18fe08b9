//! The board in result files.

use depthcal_model::{Pattern, Target};

use crate::file::Fault;

/// Most columns or rows of a board, as in `dataset.toml`.
const MOST: usize = 1000;

/// Checks the board that the file has at `place`: what counts its markers has to fit into memory.
pub(super) fn check_board(board: &Target, place: &str) -> Result<(), Fault> {
    if let Pattern::Several { boards } = &board.pattern {
        for (i, part) in boards.iter().enumerate() {
            let place = format!("{place}.boards[{i}].board");
            if matches!(part.board.pattern, Pattern::Several { .. }) {
                return Err(Fault::new(place, "is several boards again: list all boards in one place"));
            }
            check_board(&part.board, &place)?;
        }
        return Ok(());
    }
    for (field, count) in [("columns", board.columns), ("rows", board.rows)] {
        if count > MOST {
            return Err(Fault::new(format!("{place}.{field}"), format!("is {count}, boards have at most {MOST}")));
        }
    }
    Ok(())
}
