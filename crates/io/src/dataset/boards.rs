//! The boards of a dataset: `[board]`, or several in sections `[boards.NAME]`, which their tags tell apart.

use depthcal_model::{NumberedBoard, Pattern, Target};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::board::{BOARD_KEYS, board_from};
use super::error::DatasetError;
use super::section::{Field, Keys, Section, Source};

const BOARD: Field =
    Field { key: "board", remedy: "declare the board in a section [board] with kind, columns, rows, spacing_mm" };
const BOARDS: Field = Field {
    key: "boards",
    remedy: "declare one board in a section [board], or several in sections [boards.NAME] of kind \"charuco\" or \"aprilgrid\" whose tags \
             have different numbers (first_tag)",
};
const KEYS: &[&str] = &["kind", "columns", "rows", "spacing_mm", "marker_mm", "dictionary", "first_tag"];
const FIRST_TAG: Field =
    Field { key: "first_tag", remedy: "give the number of the board's first tag in its dictionary, such as 0" };
/// Dictionaries have at most so many tags.
const MOST_TAGS: usize = 100_000;

/// The sections of boards, whose keys are known.
pub(super) enum Boards<'a> {
    One(Section<'a>),
    Several(Source<'a>, &'a Spanned<DeValue<'a>>),
}

impl<'a> Boards<'a> {
    /// The sections of a file.
    ///
    /// # Errors
    /// [`DatasetError`] where there is none, both `[board]` and `[boards.NAME]`, or an unknown key in `[board]`.
    pub(super) fn of(source: Source<'a>, root: &'a DeTable<'a>, keys: Keys) -> Result<Self, DatasetError> {
        match root.get(BOARDS.key) {
            Some(value) if root.contains_key(BOARD.key) => {
                Err(source.field_error(value, BOARDS.key, BOARDS.remedy, "is declared, and so is board"))
            }
            Some(value) => Ok(Self::Several(source, value)),
            None => {
                let board = source.section(root, BOARD, BOARD_KEYS, keys)?;
                board.map(Self::One).ok_or_else(|| source.missing(BOARD))
            }
        }
    }

    /// The board that the sections declare, or the several as one.
    ///
    /// # Errors
    /// [`DatasetError`] with the line, the field and the remedy.
    pub(super) fn target(&self) -> Result<Target, DatasetError> {
        match self {
            Self::One(section) => one(section),
            Self::Several(source, value) => several(*source, value),
        }
    }
}

/// One board; from another tag than the first of the dictionary on it is one of several, of which there is one.
fn one(section: &Section<'_>) -> Result<Target, DatasetError> {
    let board = board_from(section)?;
    let first_tag = first_tag(section)?;
    if first_tag == 0 {
        return Ok(board);
    }
    if tags_of(&board, first_tag).is_none() {
        let (path, name) = (section.source.path.display(), &section.name);
        tracing::warn!("{path}: `{name}.first_tag` has no meaning for a board without tags and is ignored");
        return Ok(board);
    }
    Ok(Target::several(vec![NumberedBoard { name: BOARD.key.to_owned(), first_tag, board }]))
}

/// Number of a board's first tag; 0 where none is declared.
fn first_tag(section: &Section<'_>) -> Result<usize, DatasetError> {
    section.get(FIRST_TAG).map_or(Ok(0), |_| section.count(FIRST_TAG, 0..=MOST_TAGS))
}

fn several(source: Source<'_>, value: &Spanned<DeValue<'_>>) -> Result<Target, DatasetError> {
    let wrong = |value, problem: String| Err(source.field_error(value, BOARDS.key, BOARDS.remedy, problem));
    let Some(table) = value.get_ref().as_table() else { return wrong(value, "is not a section".to_owned()) };
    let mut sections: Vec<_> = table.iter().collect();
    // In the order of the file.
    sections.sort_by_key(|(name, _)| name.span().start);
    let mut boards: Vec<NumberedBoard> = Vec::new();
    for (name, value) in sections {
        let name = name.get_ref().to_string();
        let refused = |problem: &str| wrong(value, format!("has a board {name} {problem}"));
        let Some(table) = value.get_ref().as_table() else { return refused("that is not a section") };
        if name.is_empty() || !name.chars().all(|c| c.is_alphanumeric() || matches!(c, '_' | '-')) {
            return refused("whose name has other characters than letters, digits, - and _");
        }
        let section = Section { source, name: format!("boards.{name}"), table };
        source.deny_unknown(table, &section.name, KEYS, &[])?;
        let board = board_from(&section)?;
        let first_tag = first_tag(&section)?;
        let Some((dictionary, tags)) = tags_of(&board, first_tag) else {
            return refused("without tags, which cannot be told from others");
        };
        let meets = |other: &&NumberedBoard| {
            tags_of(&other.board, other.first_tag)
                .is_some_and(|(family, other)| family == dictionary && other.start < tags.end && tags.start < other.end)
        };
        if let Some(other) = boards.iter().find(meets) {
            return refused(&format!("some of whose tags have the numbers of those of {}", other.name));
        }
        boards.push(NumberedBoard { name, first_tag, board });
    }
    match boards.is_empty() {
        true => wrong(value, "has no section".to_owned()),
        false => Ok(Target::several(boards)),
    }
}

/// The dictionary of a board's tags, and their numbers; `None` for boards without tags.
fn tags_of(board: &Target, first_tag: usize) -> Option<(String, std::ops::Range<usize>)> {
    let (dictionary, count) = match &board.pattern {
        // Tags are in the white squares, of which there is one less than black ones where both numbers are odd.
        Pattern::Charuco { dictionary, .. } => (dictionary.to_uppercase(), board.columns * board.rows / 2),
        Pattern::Aprilgrid { .. } => ("DICT_APRILTAG_36H11".to_owned(), board.columns * board.rows),
        _ => return None,
    };
    Some((dictionary, first_tag..first_tag + count))
}
