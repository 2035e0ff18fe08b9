//! Boards whose markers carry a number: ChArUco and AprilGrid.

mod aprilgrid;
mod backend;
mod charuco;

pub(crate) use aprilgrid::find as find_aprilgrid;
pub(crate) use charuco::find as find_charuco;

use depthcal_io::GrayImage;

use crate::error::DetectError;
use crate::geometry::Homography;
use crate::stretch::{Plane, Stretch};

/// A tag that was read: its number and its corners, clockwise from the tag's own top left.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Tag {
    id: usize,
    corners: [[f64; 2]; 4],
}

/// What to read tags in, the cheapest first: the stretched image, then its enlargement.
fn attempts(image: &GrayImage) -> impl Iterator<Item = (Plane, usize)> {
    let stretches = Stretch::candidates(image);
    [1, 2]
        .into_iter()
        .flat_map(move |scale| stretches.iter().map(move |&s| (Plane::stretched(image, s), scale)))
        .filter(|(plane, scale)| *scale == 1 || plane.is_small())
}

/// OpenCV's names of the predefined dictionaries; the position is OpenCV's number.
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

/// OpenCV's number of a dictionary, in any case, with or without `DICT_`.
fn dictionary_number(name: &str) -> Result<i32, DetectError> {
    let bare = |n: &str| n.to_ascii_uppercase().trim_start_matches("DICT_").to_owned();
    let wanted = bare(name);
    DICTIONARIES
        .iter()
        .position(|known| bare(known) == wanted)
        .map(|number| number as i32)
        .ok_or_else(|| DetectError::UnknownDictionary { name: name.to_owned() })
}

/// Drops tags that contradict the others (misread numbers), given the corners of every tag on the board. `tolerance` is
/// in units of a tag's side as seen.
fn consistent(mut tags: Vec<Tag>, board_corners: impl Fn(usize) -> Option<[[f64; 2]; 4]>, tolerance: f64) -> Vec<Tag> {
    tags.retain(|tag| board_corners(tag.id).is_some());
    // The same number twice: neither can be trusted.
    let copy = tags.clone();
    tags.retain(|tag| copy.iter().filter(|other| other.id == tag.id).count() == 1);
    tags.sort_by_key(|tag| tag.id);
    // The reference is the tag that most others agree with, through the homography of its own corners and of theirs.
    let agreement = |a: &Tag, b: &Tag| {
        let pairs: Option<Vec<_>> = [a, b]
            .into_iter()
            .map(|tag| Some(board_corners(tag.id)?.into_iter().zip(tag.corners).collect::<Vec<_>>()))
            .collect::<Option<Vec<_>>>()
            .map(|lists| lists.concat());
        pairs.is_some_and(|pairs| worst(&pairs) < tolerance * side(b).min(side(a)))
    };
    let supporters = |a: &Tag| tags.iter().filter(|b| agreement(a, b)).copied().collect::<Vec<_>>();
    tags.iter().map(supporters).max_by_key(Vec::len).unwrap_or_default()
}

fn side(tag: &Tag) -> f64 {
    let c = tag.corners;
    (0..4).map(|i| (c[i][0] - c[(i + 1) % 4][0]).hypot(c[i][1] - c[(i + 1) % 4][1])).fold(f64::INFINITY, f64::min)
}

/// Largest distance from the fitted homography.
fn worst(pairs: &[([f64; 2], [f64; 2])]) -> f64 {
    let Some(map) = Homography::fit(pairs) else { return f64::INFINITY };
    pairs
        .iter()
        .map(|(p, q)| map.apply(*p).map_or(f64::INFINITY, |r| (r[0] - q[0]).hypot(r[1] - q[1])))
        .fold(0.0, f64::max)
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

    #[test]
    fn a_misread_tag_is_dropped() {
        let board = |id: usize| {
            (id < 9).then(|| {
                let (x, y) = ((id % 3) as f64 * 30.0, (id / 3) as f64 * 30.0);
                [[x, y], [x + 20.0, y], [x + 20.0, y + 20.0], [x, y + 20.0]]
            })
        };
        let seen = |id: usize| board(id).expect("on the board").map(|p| [2.0 * p[0] + 50.0, 2.0 * p[1] + 60.0]);
        let mut tags: Vec<Tag> = (0..9).map(|id| Tag { id, corners: seen(id) }).collect();
        tags[4].corners = seen(7);
        tags.push(Tag { id: 17, corners: seen(0) });
        let ids: Vec<usize> = consistent(tags, board, 0.2).iter().map(|t| t.id).collect();
        assert_eq!(ids, [0, 1, 2, 3, 5, 6, 7, 8]);
    }
}
