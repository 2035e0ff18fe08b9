//! The markers around a marker, and the map from board to image there.

use std::collections::BTreeMap;

use depthcal_model::target::Target;

use crate::geometry::{Homography, Pair};

/// Number of nearest markers that give the map around a marker.
const NEAREST: usize = 12;
/// Distance within which they lie, in spacings of the board.
const NEAR: f64 = 2.9;

/// The nearest markers to marker `index` on the board, of those given, the nearest first; with or without itself.
pub(super) fn near(target: &Target, index: usize, itself: bool, among: impl Iterator<Item = usize>) -> Vec<usize> {
    let [x, y] = target.point(index);
    let mut near: Vec<(f64, usize)> = among
        .filter(|&i| itself || i != index)
        .map(|i| {
            let [u, v] = target.point(i);
            ((u - x).hypot(v - y) / target.spacing_mm, i)
        })
        .filter(|(distance, _)| *distance < NEAR)
        .collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    near.truncate(NEAREST);
    near.into_iter().map(|(_, i)| i).collect()
}

/// The map from board (mm) to image (px) around a marker, from the nearest markers; `None` where they do not determine
/// it.
pub(super) fn local_map(
    target: &Target,
    index: usize,
    itself: bool,
    places: &BTreeMap<usize, [f64; 2]>,
) -> Option<Homography> {
    let pairs: Vec<Pair> = near(target, index, itself, places.keys().copied())
        .into_iter()
        .map(|i| (target.point(i), places[&i]))
        .collect();
    Homography::fit(&pairs)
}
