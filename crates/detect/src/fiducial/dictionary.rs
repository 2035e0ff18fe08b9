//! OpenCV's dictionaries by name.

use crate::error::DetectError;

/// OpenCV's predefined dictionaries; the position in this list is OpenCV's number.
const DICTIONARIES: [&str; 21] = [
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
    "DICT_APRILTAG_16H5",
    "DICT_APRILTAG_25H9",
    "DICT_APRILTAG_36H10",
    "DICT_APRILTAG_36H11",
];

/// OpenCV's number of the dictionary called `name`, in upper or lower case, with or without `DICT_`.
pub(super) fn dictionary_number(name: &str) -> Result<i32, DetectError> {
    let bare = |n: &str| n.to_ascii_uppercase().trim_start_matches("DICT_").to_owned();
    let wanted = bare(name);
    DICTIONARIES
        .iter()
        .position(|known| bare(known) == wanted)
        .map(|number| number as i32)
        .ok_or_else(|| DetectError::UnknownDictionary { name: name.to_owned() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dictionaries_by_name() {
        assert_eq!(dictionary_number("DICT_5X5_100").expect("known"), 5);
        assert_eq!(dictionary_number("apriltag_36h11").expect("known"), 20);
        assert!(matches!(dictionary_number("DICT_5X5_99"), Err(DetectError::UnknownDictionary { .. })));
    }
}
