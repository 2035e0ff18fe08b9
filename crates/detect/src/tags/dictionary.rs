//! Dictionaries of tags: which cells of which tag are black.

use calib_targets_aruco::builtins::builtin_dictionary;

use crate::error::DetectError;

/// Dictionaries by OpenCV's names; the position in this list is OpenCV's number.
const NAMES: [&str; 22] = [
    "DICT_4X4_50",
    "DICT_4X4_100",
    "DICT_4X4_250",
    "DICT_4X4_1000",
    "DICT_5X5_50",
    "DICT_5X5_100",
    "DICT_5X5_250",
    "DICT_5X5_1000",
    "DICT_6X6_50",
    "DICT_6X6_100",
    "DICT_6X6_250",
    "DICT_6X6_1000",
    "DICT_7X7_50",
    "DICT_7X7_100",
    "DICT_7X7_250",
    "DICT_7X7_1000",
    "DICT_ARUCO_ORIGINAL",
    "DICT_APRILTAG_16h5",
    "DICT_APRILTAG_25h9",
    "DICT_APRILTAG_36h10",
    "DICT_APRILTAG_36h11",
    "DICT_ARUCO_MIP_36h12",
];

/// The tags of a board: the first ones of a dictionary, squares of black and white cells.
#[derive(Debug, Clone)]
pub(crate) struct Dictionary {
    /// OpenCV's number.
    #[cfg_attr(not(feature = "opencv"), allow(dead_code))]
    pub(crate) number: i32,
    /// Cells along a side, without the border.
    side: usize,
    /// Cells of every tag, row by row from the highest bit, 1 for white.
    codes: Vec<u64>,
    /// Number of wrong cells with which a tag is still told from all others.
    correctable: u32,
}

/// A tag whose cells are as they were seen, or nearly.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Match {
    /// Number of the tag.
    pub(crate) id: usize,
    /// Quarter turns, anticlockwise, that bring the cells as seen into those of the dictionary.
    pub(crate) turns: usize,
    /// Number of cells that differ.
    pub(crate) wrong: u32,
}

impl Dictionary {
    /// The first `need` tags of the dictionary called `name`, in upper or lower case, with or without `DICT_`.
    ///
    /// # Errors
    /// [`DetectError::UnknownDictionary`], [`DetectError::DictionaryTooSmall`].
    pub(crate) fn with_tags(name: &str, need: usize) -> Result<Dictionary, DetectError> {
        let bare = |n: &str| n.to_ascii_uppercase().trim_start_matches("DICT_").to_owned();
        let unknown = || DetectError::UnknownDictionary { name: name.to_owned() };
        let wanted = bare(name);
        let number = NAMES.iter().position(|known| bare(known) == wanted).ok_or_else(unknown)?;
        let table = builtin_dictionary(NAMES[number]).ok_or_else(unknown)?;
        let side = table.marker_size;
        // The table has 1 for black, and the first cell in the lowest bit.
        let cells = side * side;
        let got = table.codes.len();
        if got < need {
            return Err(DetectError::DictionaryTooSmall { dictionary: name.to_owned(), need, got });
        }
        let codes: Vec<u64> =
            table.codes.iter().take(need).map(|code| (!code).reverse_bits() >> (64 - cells)).collect();
        Ok(Dictionary { number: number as i32, side, correctable: correctable(&codes, side), codes })
    }

    /// All tags of the dictionary called `name`; `None` where there is none.
    pub(crate) fn whole(name: &str) -> Option<Dictionary> {
        Self::with_tags(name, builtin_dictionary(name)?.codes.len()).ok()
    }

    /// Cells along a tag's side, without its border.
    pub(crate) fn side(&self) -> usize {
        self.side
    }

    /// The cells of tag `id`, row by row, with its black border of one cell: whether each is white.
    pub(crate) fn cells(&self, id: usize) -> Vec<Vec<bool>> {
        let n = self.side;
        let code = self.codes[id];
        let white = |row: usize, column: usize| {
            let inside = (1..=n).contains(&row) && (1..=n).contains(&column);
            inside && code >> (n * n - 1 - ((row - 1) * n + column - 1)) & 1 == 1
        };
        (0..n + 2).map(|row| (0..n + 2).map(|column| white(row, column)).collect()).collect()
    }

    /// The tag whose cells differ least from `seen` (row by row from the highest bit, 1 for white),
    /// turned as it may be; `None` where all differ in more cells than can be corrected with safety.
    pub(crate) fn identify(&self, seen: u64) -> Option<Match> {
        let mut best: Option<Match> = None;
        let mut code = seen;
        for turns in 0..4 {
            for (id, known) in self.codes.iter().enumerate() {
                let wrong = (known ^ code).count_ones();
                if wrong <= self.correctable && best.is_none_or(|b| wrong < b.wrong) {
                    best = Some(Match { id, turns, wrong });
                }
            }
            code = turned(code, self.side);
        }
        best
    }
}

/// The cells of a square of `side` cells after a quarter turn, anticlockwise.
fn turned(code: u64, side: usize) -> u64 {
    let mut out = 0;
    for row in 0..side {
        for column in 0..side {
            // What is in the last column comes into the first row.
            let from = column * side + (side - 1 - row);
            out = out << 1 | (code >> (side * side - 1 - from) & 1);
        }
    }
    out
}

/// Half of what half the smallest distance between two tags allows: not only must the next tag be farther, noise must be
/// unlikely to look like any.
fn correctable(codes: &[u64], side: usize) -> u32 {
    let mut least = u32::MAX;
    for (i, &code) in codes.iter().enumerate() {
        let mut seen = code;
        for turns in 0..4 {
            // A tag must be told from itself after a turn, too.
            let others = if turns == 0 { &codes[..i] } else { &codes[..=i] };
            for &other in others {
                least = least.min((seen ^ other).count_ones());
            }
            seen = turned(seen, side);
        }
    }
    least.saturating_sub(1) / 2 * 3 / 5
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dictionaries_by_name() {
        assert_eq!(Dictionary::with_tags("DICT_5X5_100", 1).expect("known").number, 5);
        assert_eq!(Dictionary::with_tags("apriltag_36h11", 1).expect("known").number, 20);
        assert!(matches!(Dictionary::with_tags("DICT_5X5_99", 1), Err(DetectError::UnknownDictionary { .. })));
        let small = Dictionary::with_tags("DICT_5X5_50", 60);
        assert!(matches!(small, Err(DetectError::DictionaryTooSmall { need: 60, got: 50, .. })));
        for name in NAMES {
            let dictionary = Dictionary::with_tags(name, 30).expect(name);
            assert!(dictionary.codes.iter().all(|code| code >> (dictionary.side * dictionary.side - 1) <= 1), "{name}");
        }
    }

    #[test]
    fn a_turned_tag_is_identified_with_its_turn() {
        let dictionary = Dictionary::with_tags("DICT_6X6_250", 250).expect("known");
        for id in [0, 7, 249] {
            let mut seen = dictionary.codes[id];
            for turns in [0, 3, 2, 1] {
                assert_eq!(dictionary.identify(seen), Some(Match { id, turns, wrong: 0 }));
                assert_eq!(dictionary.identify(seen ^ 1 << 20).map(|m| (m.id, m.wrong)), Some((id, 1)));
                seen = turned(seen, 6);
            }
        }
    }
}
