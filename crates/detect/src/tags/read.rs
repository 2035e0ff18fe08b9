//! Tags in an image.

use super::cells;
use super::dictionary::Match;
use super::quad::{Quad, around, lengths};
use super::regions::outlines;
use super::sides::fitted;
use super::tag::{Reading, Tag};
use super::threshold::dark;
use crate::stretch::Plane;

/// Levels of the threshold between the darkest and the brightest value around a pixel. At the second, tags that touch other print
/// by their corners come apart; at the third, thin borders that blur has lightened hold together.
pub(super) const LEVELS: [f32; 3] = [0.5, 0.3, 0.7];
/// Least size of a cell, px.
pub(super) const LEAST_CELL_PX: f64 = 1.25;

/// Reads the tags of a dictionary in an image, in the order in which they are found.
pub(crate) fn read_tags(plane: &Plane, reading: &Reading) -> Vec<Tag> {
    let enlarged;
    let (plane, scale) = match reading.scale {
        1 => (plane, 1.0),
        _ => {
            enlarged = plane.doubled();
            (&enlarged, 2.0)
        }
    };
    let (dictionary, border) = (reading.dictionary, reading.border);
    let across = dictionary.side() + 2 * border;
    let least = LEAST_CELL_PX * across as f64;
    let mut matched: Vec<(Tag, Match)> = Vec::new();
    for level in LEVELS {
        for outline in outlines(&dark(plane, level), plane.width, least as usize) {
            let read = around(outline, least).and_then(|quad| fitted(plane, &quad, across)).and_then(|quad| {
                let seen = cells::read(plane, &quad, dictionary.side(), border)?;
                let known = dictionary.identify(seen)?;
                Some((tag(&quad, &known), known))
            });
            let Some((tag, known)) = read else { continue };
            match matched.iter_mut().find(|(other, _)| same(other, &tag)) {
                Some(other) if known.wrong < other.1.wrong => *other = (tag, known),
                Some(_) => {}
                None => matched.push((tag, known)),
            }
        }
    }
    let unscaled = |p: [f64; 2]| p.map(|v| (v + 0.5) / scale - 0.5);
    matched.into_iter().map(|(tag, _)| Tag { corners: tag.corners.map(unscaled), ..tag }).collect()
}

/// The tag with its corners from its own top left. After a quarter turn, anticlockwise, the second corner is the first.
fn tag(quad: &Quad, known: &Match) -> Tag {
    Tag { id: known.id, corners: std::array::from_fn(|i| quad[(i + known.turns) % 4]) }
}

/// Whether two tags are one in the image.
pub(super) fn same(a: &Tag, b: &Tag) -> bool {
    let middle = |t: &Tag| [0, 1].map(|axis| t.corners.iter().map(|c| c[axis]).sum::<f64>() / 4.0);
    let (p, q) = (middle(a), middle(b));
    let side = lengths(&a.corners).into_iter().fold(f64::INFINITY, f64::min);
    (p[0] - q[0]).hypot(p[1] - q[1]) < side / 2.0
}
