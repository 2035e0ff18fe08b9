//! Tags that agree with each other.

use crate::geometry::Homography;
use crate::tags::Tag;

/// The tags that agree with each other; misread numbers are dropped. `board_corners` gives the corners of every tag of
/// the board, mm; `tolerance` is the largest deviation in units of a tag's side in the image.
pub(super) fn consistent(
    mut tags: Vec<Tag>,
    board_corners: impl Fn(usize) -> Option<[[f64; 2]; 4]>,
    tolerance: f64,
) -> Vec<Tag> {
    tags.retain(|tag| board_corners(tag.id).is_some());
    // When a number was read twice, neither reading can be trusted.
    let copy = tags.clone();
    tags.retain(|tag| copy.iter().filter(|other| other.id == tag.id).count() == 1);
    tags.sort_by_key(|tag| tag.id);
    // Two tags agree when one homography fits the corners of both. The tag with which most others agree is the
    // reference.
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

/// Shortest side of a tag in the image, px.
fn side(tag: &Tag) -> f64 {
    let c = tag.corners;
    (0..4).map(|i| (c[i][0] - c[(i + 1) % 4][0]).hypot(c[i][1] - c[(i + 1) % 4][1])).fold(f64::INFINITY, f64::min)
}

/// Largest distance (px) of the pairs (board mm, image px) from the homography fitted to them.
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
