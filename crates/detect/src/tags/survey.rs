//! Tags of any dictionary in an image, also of one that is mirrored: for boards whose declaration does not fit.

use depthcal_io::GrayImage;

use super::cells;
use super::dictionary::Dictionary;
use super::quad::{Quad, around};
use super::read::{LEAST_CELL_PX, LEVELS, same};
use super::regions::outlines;
use super::sides::fitted;
use super::tag::Tag;
use super::threshold::dark;
use crate::stretch::{Plane, Stretch};

/// Dictionaries that contain all others of their kind.
const FAMILIES: [&str; 10] = [
    "DICT_4X4_1000",
    "DICT_5X5_1000",
    "DICT_6X6_1000",
    "DICT_7X7_1000",
    "DICT_ARUCO_ORIGINAL",
    "DICT_APRILTAG_16h5",
    "DICT_APRILTAG_25h9",
    "DICT_APRILTAG_36h10",
    "DICT_APRILTAG_36h11",
    "DICT_ARUCO_MIP_36h12",
];
/// Widths of the black border in cells that are tried.
const BORDERS: [usize; 2] = [1, 2];

/// A tag that was seen: its number and its corners (px) from its own top left, clockwise on the print.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SeenTag {
    /// Its number in the dictionary.
    pub id: usize,
    /// Its corners, px.
    pub corners: [[f64; 2]; 4],
}

/// Tags of one dictionary that were seen in an image.
#[derive(Debug, Clone, PartialEq)]
pub struct SeenTags {
    /// OpenCV's name of the dictionary.
    pub dictionary: &'static str,
    /// Whether the tags are legible only in the mirrored image.
    pub is_mirrored: bool,
    /// The tags.
    pub tags: Vec<SeenTag>,
}

/// All tags in an image, by dictionary and by whether the image is mirrored. Dictionaries share some tags, and now and then
/// what is no tag is read as one: the dictionary of a board is that of most tags.
pub fn survey_tags(image: &GrayImage) -> Vec<SeenTags> {
    let dictionaries: Vec<Dictionary> = FAMILIES.iter().filter_map(|name| Dictionary::whole(name)).collect();
    let mut seen: Vec<SeenTags> = FAMILIES
        .iter()
        .flat_map(|dictionary| [false, true].map(|is_mirrored| SeenTags { dictionary, is_mirrored, tags: Vec::new() }))
        .collect();
    let stretch = Stretch::candidates(image).first().copied();
    let Some(plane) = stretch.map(|stretch| Plane::stretched(image, stretch)) else { return Vec::new() };
    let enlarged = plane.is_small().then(|| plane.doubled());
    let (plane, scale) = enlarged.as_ref().map_or((&plane, 1.0), |enlarged| (enlarged, 2.0));
    let unscaled = |p: [f64; 2]| p.map(|v| (v + 0.5) / scale - 0.5);
    for level in LEVELS {
        for outline in outlines(&dark(plane, level), plane.width, (6.0 * LEAST_CELL_PX) as usize) {
            let Some(around) = around(outline, 6.0 * LEAST_CELL_PX) else { continue };
            for (number, dictionary) in dictionaries.iter().enumerate() {
                for (is_mirrored, id, quad) in read(plane, &around, dictionary) {
                    let tag = Tag { id, corners: quad };
                    let tags = &mut seen[2 * number + usize::from(is_mirrored)].tags;
                    let corners = quad.map(unscaled);
                    if !tags
                        .iter()
                        .any(|other| same(&Tag { id: other.id, corners: other.corners }, &Tag { corners, ..tag }))
                    {
                        tags.push(SeenTag { id, corners });
                    }
                }
            }
        }
    }
    seen.retain(|of_dictionary| !of_dictionary.tags.is_empty());
    seen
}

/// The tags of a dictionary that a quadrilateral may be: whether mirrored, number, corners from the tag's own top left.
fn read(plane: &Plane, around: &Quad, dictionary: &Dictionary) -> Vec<(bool, usize, Quad)> {
    let side = dictionary.side();
    let mut tags = Vec::new();
    for border in BORDERS {
        let Some(quad) = fitted(plane, around, side + 2 * border) else { continue };
        let Some(seen) = cells::read(plane, &quad, side, border) else { continue };
        for (is_mirrored, code) in [(false, seen), (true, mirrored(seen, side))] {
            if let Some(known) = dictionary.identify(code) {
                // The mirrored quadrilateral begins at the other end of its first side.
                let corner = |i: usize| if is_mirrored { quad[(5 - i) % 4] } else { quad[i % 4] };
                tags.push((is_mirrored, known.id, std::array::from_fn(|i| corner((i + known.turns) % 4))));
            }
        }
    }
    tags
}

/// The cells of a square of `side` cells with every row in the other order.
fn mirrored(code: u64, side: usize) -> u64 {
    let bit = |row: usize, column: usize| code >> (side * side - 1 - (row * side + column)) & 1;
    (0..side * side).fold(0, |out, i| out << 1 | bit(i / side, side - 1 - i % side))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A print of tags of one dictionary, as it is and mirrored.
    #[test]
    fn tags_of_any_dictionary_are_seen_also_in_a_mirrored_image() {
        for name in ["DICT_5X5_100", "DICT_APRILTAG_36h11"] {
            let (cell, count) = (6, 4);
            let dictionary = Dictionary::with_tags(name, count).expect("known");
            let across = (dictionary.side() + 2) * cell;
            let (width, height) = (count * (across + 40) + 40, across + 80);
            let mut image = GrayImage { width, height, data: vec![230; width * height], bits: 8 };
            for id in 0..count {
                let cells = dictionary.cells(id);
                for (x, y) in (0..across * across).map(|i| (i % across, i / across)) {
                    if !cells[y / cell][x / cell] {
                        image.data[(40 + y) * width + 40 + id * (across + 40) + x] = 20;
                    }
                }
            }
            let mut mirror = image.clone();
            mirror.data.chunks_exact_mut(width).for_each(<[u16]>::reverse);
            for (image, is_mirrored) in [(image, false), (mirror, true)] {
                let seen = survey_tags(&image);
                let most = seen.iter().max_by_key(|seen| seen.tags.len()).expect("tags");
                let mut ids: Vec<usize> = most.tags.iter().map(|tag| tag.id).collect();
                ids.sort_unstable();
                assert_eq!((most.is_mirrored, ids), (is_mirrored, vec![0, 1, 2, 3]), "{name}");
                assert_eq!(most.dictionary.contains("5X5"), name.contains("5X5"));
            }
        }
    }
}
