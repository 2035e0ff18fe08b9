//! ChArUco boards: the tags locate the board, and the crossings of its chessboard are the markers. All crossings that
//! follow from those beside legible tags are found; a board without any legible tag is found by its crossings.

use std::collections::BTreeMap;

use depthcal_io::GrayImage;
use depthcal_model::target::{CharucoLayout, Pattern, Target};

use super::attempts::attempts;
use super::consistent::consistent;
use super::extend::extend;
use super::placement::{Crossings, Placed, Print, place};
use super::reader::read_tags;
use crate::chessboard::saddles::lattices;
use crate::detection::{DetectOptions, Detection, Marker, Polarity};
use crate::error::DetectError;
use crate::geometry::{Homography, Pair};
use crate::stretch::{Plane, Stretch};
use crate::tags::dictionary::Dictionary;
use crate::tags::{Reading, Tag};

/// Number of tags that agree with each other, in one layout more than in the other, from which on their numbers are beyond doubt.
const SURE_TAGS: usize = 3;
/// Least number of crossings from which a board without legible tags is identified.
const LEAST_CROSSINGS: usize = 12;
/// Standard deviations of the smoothing with which crossings are searched, px: the second for blurred images and large
/// squares.
const CROSSING_SMOOTHING: [f32; 2] = [1.5, 3.0];
/// Distance from the image border, px, within which a crossing is not expected to be found.
const BORDER_PX: f64 = 4.0;

/// Column and row of the square that carries tag `id`; `None` when the board has fewer tags. Tags are numbered row by
/// row over the white squares. `first_white` is the column of the first white square: 1 when the top left square is
/// black, 0 when it has a tag.
pub fn square_of(id: usize, columns: usize, rows: usize, first_white: usize) -> Option<[usize; 2]> {
    let mut left = id;
    for row in 0..rows {
        let start = (row + first_white) % 2;
        let count = columns.saturating_sub(start).div_ceil(2);
        if left < count {
            return Some([start + 2 * left, row]);
        }
        left -= count;
    }
    None
}

/// The corners of tag `id` on the board, mm, clockwise from the top left; `None` when the board has fewer tags.
fn tag_corners(target: &Target, marker_mm: f64, id: usize, first_white: usize) -> Option<[[f64; 2]; 4]> {
    let [column, row] = square_of(id, target.columns, target.rows, first_white)?;
    let margin = (target.spacing_mm - marker_mm) / 2.0;
    let low = [column as f64 * target.spacing_mm + margin, row as f64 * target.spacing_mm + margin];
    let high = [low[0] + marker_mm, low[1] + marker_mm];
    Some([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
}

/// The layouts that a board may have, and the column of the first white square in each.
fn layouts(target: &Target, known: Option<CharucoLayout>) -> Vec<(CharucoLayout, usize)> {
    let mut all = vec![(CharucoLayout::Current, 1)];
    // With an odd number of rows all boards begin with a black square.
    if target.rows.is_multiple_of(2) {
        all.push((CharucoLayout::Legacy, 0));
        all.retain(|(layout, _)| known.is_none_or(|known| known == *layout));
    }
    all
}

/// Markers, and the layout of the tags from which they are known.
#[derive(Default)]
struct Found {
    markers: Vec<Marker>,
    layout: Option<CharucoLayout>,
}

impl Found {
    fn keep_better(&mut self, other: Found) {
        if other.markers.len() > self.markers.len() {
            *self = other;
        }
    }
}

/// Searches an image for a ChArUco board: first for its tags, then, where they cannot be read, for its crossings.
pub(crate) fn find(
    image: &GrayImage,
    target: &Target,
    dictionary: &str,
    options: &DetectOptions,
) -> Result<Option<Detection>, DetectError> {
    let Pattern::Charuco { marker_mm, .. } = target.pattern else { return Ok(None) };
    let dictionary = Dictionary::with_tags(dictionary, options.first_tag + target.columns * target.rows / 2)?;
    let layouts = layouts(target, options.charuco_layout);
    let print = print(target, (&dictionary, options.first_tag), &layouts);
    let least = options.min_markers.max(4);
    let mut best = Found::default();
    let mut crossings_tried = false;
    for (plane, scale) in attempts(image) {
        // Tags that are too blurred to be read are not made legible by enlarging them.
        if scale > 1 && !crossings_tried && best.markers.len() < least {
            crossings_tried = true;
            best.keep_better(from_crossings(image, &print, least, options));
            if is_complete(&best.markers, target, image, least) {
                break;
            }
        }
        let tags = read_tags(&plane, &Reading { dictionary: &dictionary, border: 1, scale }, options)?;
        let candidates = layouts.iter().map(|&(layout, first)| {
            (layout, first, consistent(tags.clone(), |id| tag_corners(target, marker_mm, id, first), 0.2))
        });
        let candidates: Vec<_> = candidates.collect();
        let most = candidates.iter().map(|(_, _, tags)| tags.len()).max().unwrap_or(0);
        if most == 0 {
            continue;
        }
        // Tags of every other row alone fit in both layouts, one square apart: then the tags between the crossings decide.
        let is_sure = most >= SURE_TAGS && candidates.iter().filter(|(_, _, tags)| tags.len() == most).count() == 1;
        for (layout, first_white, tags) in candidates.into_iter().filter(|(_, _, tags)| tags.len() == most) {
            let mut markers = predict(&tags, target, |id| tag_corners(target, marker_mm, id, first_white));
            if options.refine {
                markers = extend(image, target, &markers);
            }
            if is_sure || is_confirmed(&markers, &print, &plane) {
                best.keep_better(Found { markers, layout: Some(layout) });
            }
        }
        if is_complete(&best.markers, target, image, least) {
            break;
        }
    }
    if !crossings_tried && best.markers.len() < least {
        best.keep_better(from_crossings(image, &print, least, options));
    }
    let Found { markers, layout } = best;
    let charuco_layout = layout.filter(|_| target.rows.is_multiple_of(2));
    Ok((markers.len() >= least).then_some(Detection { markers, polarity: Polarity::DarkOnBright, charuco_layout }))
}

/// The printed tags of the board, from the first of them on, in every layout that it may have.
fn print<'a>(
    target: &'a Target,
    (dictionary, first_tag): (&Dictionary, usize),
    layouts: &[(CharucoLayout, usize)],
) -> Print<'a> {
    let mut all = Vec::new();
    for &(layout, first_white) in layouts {
        let mut tags = BTreeMap::new();
        let mut id = 0;
        while let Some(square) = square_of(id, target.columns, target.rows, first_white) {
            tags.insert(square, dictionary.cells(first_tag + id));
            id += 1;
        }
        all.push((layout, tags));
    }
    Print { target, layouts: all }
}

/// Whether nine tenths of the crossings that lie in the image are found.
fn is_complete(markers: &[Marker], target: &Target, image: &GrayImage, least: usize) -> bool {
    if markers.len() < least {
        return false;
    }
    let pairs: Vec<Pair> = markers.iter().map(|m| (target.point(m.index), m.pixel)).collect();
    let Some(map) = Homography::fit(&pairs) else { return false };
    let (width, height) = (image.width as f64, image.height as f64);
    let visible = target
        .points()
        .into_iter()
        .filter_map(|p| map.apply(p))
        .filter(|[u, v]| *u > BORDER_PX && *v > BORDER_PX && *u < width - BORDER_PX && *v < height - BORDER_PX)
        .count();
    10 * markers.len() >= 9 * visible
}

/// Whether the tags between the crossings confirm the crossings' places on the board.
fn is_confirmed(markers: &[Marker], print: &Print, plane: &Plane) -> bool {
    let columns = print.target.columns - 1;
    let node = |index: usize| [(index % columns) as i32, (index / columns) as i32];
    let crossings: Crossings = markers.iter().map(|m| (node(m.index), m.pixel)).collect();
    place(&crossings, print, plane)
        .is_some_and(|placed| markers.iter().all(|m| placed.indices.get(&node(m.index)) == Some(&m.index)))
}

/// The markers from the crossings of the image, placed by the tags between them.
fn from_crossings(image: &GrayImage, print: &Print, least: usize, options: &DetectOptions) -> Found {
    for &stretch in Stretch::candidates(image) {
        let plane = Plane::stretched(image, stretch);
        for sigma in CROSSING_SMOOTHING {
            for crossings in lattices(&plane, sigma, least.max(LEAST_CROSSINGS)) {
                let Some(Placed { indices, layout }) = place(&crossings, print, &plane) else { continue };
                let layout = Some(layout);
                let mut markers: Vec<Marker> =
                    indices.into_iter().map(|(node, index)| Marker { index, pixel: crossings[&node] }).collect();
                markers.sort_by_key(|m| m.index);
                if !options.refine {
                    return Found { markers, layout };
                }
                let markers = extend(image, print.target, &markers);
                if markers.len() >= least && is_confirmed(&markers, print, &plane) {
                    return Found { markers, layout };
                }
            }
        }
    }
    Found::default()
}

/// Positions of the crossings, each predicted from the nearest tags; crossings without a tag next to them are left out.
fn predict(tags: &[Tag], target: &Target, corners_of: impl Fn(usize) -> Option<[[f64; 2]; 4]>) -> Vec<Marker> {
    let mut markers = Vec::new();
    for index in 0..target.len() {
        let p = target.point(index);
        let mut near: Vec<(f64, Vec<Pair>)> = tags
            .iter()
            .filter_map(|tag| {
                let board = corners_of(tag.id)?;
                let middle = [(board[0][0] + board[2][0]) / 2.0, (board[0][1] + board[2][1]) / 2.0];
                let distance = (middle[0] - p[0]).hypot(middle[1] - p[1]) / target.spacing_mm;
                (distance < 2.0).then(|| (distance, board.into_iter().zip(tag.corners).collect()))
            })
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        // A crossing touches two white squares; when no tag was read in either it is hidden or unclear.
        if near.first().is_none_or(|n| n.0 > 0.8) {
            continue;
        }
        let pairs: Vec<_> = near.into_iter().take(4).flat_map(|n| n.1).collect();
        if let Some(pixel) = Homography::fit(&pairs).and_then(|map| map.apply(p)) {
            markers.push(Marker { index, pixel });
        }
    }
    markers
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tags_are_numbered_through_the_white_squares() {
        // Black top left: the first tag is in the second square.
        assert_eq!(square_of(0, 5, 4, 1), Some([1, 0]));
        assert_eq!(square_of(1, 5, 4, 1), Some([3, 0]));
        assert_eq!(square_of(2, 5, 4, 1), Some([0, 1]));
        assert_eq!(square_of(0, 5, 4, 0), Some([0, 0]));
        assert_eq!(square_of(10, 5, 4, 1), None);
    }
}
