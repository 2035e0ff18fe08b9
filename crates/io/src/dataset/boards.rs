//! The boards of a rig's dataset: `[board]`, or several in sections `[boards.NAME]`, which their tags tell apart.

use depthcal_model::{NumberedBoard, Pattern, Target};
use toml::de::DeTable;

use super::declaration::{BOARD, board_from, board_section};
use super::error::DatasetError;
use super::section::{Field, Section, Source};

/// Name of the table of the sections.
pub(crate) const BOARDS: &str = "boards";
const KEYS: &[&str] = &["kind", "columns", "rows", "spacing_mm", "marker_mm", "dictionary", "first_tag"];
const SEVERAL: Field = Field {
    name: "boards",
    remedy: "declare one board in a section [board], or several in sections [boards.NAME] of kind \"charuco\" or \"aprilgrid\" whose tags \
             have different numbers (first_tag)",
};
const FIRST_TAG: Field = Field {
    name: "boards.NAME.first_tag",
    remedy: "give the number of the board's first tag in its dictionary, such as 0",
};
/// Dictionaries have at most so many tags.
const MOST_TAGS: usize = 100_000;

/// The board that a file declares, or the several.
///
/// # Errors
/// [`DatasetError`] with the line, the field and the remedy.
pub(crate) fn boards_of(source: Source<'_>, root: &DeTable<'_>) -> Result<Target, DatasetError> {
    let Some(value) = root.get(BOARDS) else { return board_from(&board_section(source, root)?) };
    if root.contains_key(BOARD.name) {
        return Err(source.field_error(value, SEVERAL, "is declared, and so is board"));
    }
    let Some(table) = value.get_ref().as_table() else {
        return Err(source.field_error(value, SEVERAL, "is not a section"));
    };
    let mut sections: Vec<_> = table.iter().collect();
    // In the order of the file.
    sections.sort_by_key(|(name, _)| name.span().start);
    let mut boards: Vec<NumberedBoard> = Vec::new();
    for (name, value) in sections {
        let name = name.get_ref().to_string();
        let refused = |problem: &str| Err(source.field_error(value, SEVERAL, format!("has a board {name} {problem}")));
        let Some(table) = value.get_ref().as_table() else { return refused("that is not a section") };
        if name.is_empty() || !name.chars().all(|c| c.is_alphanumeric() || matches!(c, '_' | '-')) {
            return refused("whose name has other characters than letters, digits, - and _");
        }
        source.deny_unknown(table, &format!("boards.{name}."), KEYS, &[])?;
        let section = Section { source, table };
        let board = board_from(&section)?;
        let first_tag =
            section.get(FIRST_TAG).map(|_| section.count(FIRST_TAG, 0..=MOST_TAGS)).transpose()?.unwrap_or(0);
        let Some(numbering) = tags_of(&board, first_tag) else {
            return refused("without tags, which cannot be told from others");
        };
        let meets = |other: &&NumberedBoard| {
            tags_of(&other.board, other.first_tag).is_some_and(|(family, tags)| {
                family == numbering.0 && tags.start < numbering.1.end && numbering.1.start < tags.end
            })
        };
        if let Some(other) = boards.iter().find(meets) {
            return refused(&format!("some of whose tags have the numbers of those of {}", other.name));
        }
        boards.push(NumberedBoard { name, first_tag, board });
    }
    match boards.is_empty() {
        true => Err(source.field_error(value, SEVERAL, "has no section")),
        false => Ok(Target::several(boards)),
    }
}

/// The dictionary of a board's tags, and their numbers; `None` for boards without tags.
fn tags_of(board: &Target, first_tag: usize) -> Option<(String, std::ops::Range<usize>)> {
    let (dictionary, count) = match &board.pattern {
        Pattern::Charuco { dictionary, .. } => (dictionary.to_uppercase(), (board.columns * board.rows).div_ceil(2)),
        Pattern::Aprilgrid { .. } => ("DICT_APRILTAG_36H11".to_owned(), board.columns * board.rows),
        _ => return None,
    };
    Some((dictionary, first_tag..first_tag + count))
}
