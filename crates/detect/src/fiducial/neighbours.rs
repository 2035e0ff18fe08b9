//! The markers around a marker, and the map from board to image there.

use std::collections::BTreeMap;

use depthcal_model::target::Target;
use nalgebra::{Matrix3, SMatrix, Vector3};

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

/// Where the markers around a marker predict it (px), and by what factor such a prediction scatters more about the marker
/// than the markers about their own map: √(1 + trace(J N⁻¹ Jᵀ)/2), with the homography's Jacobian J at the marker and the
/// normal matrix N of its neighbours. It is large where the marker lies outside of them.
pub(super) fn prediction(target: &Target, index: usize, places: &BTreeMap<usize, [f64; 2]>) -> Option<([f64; 2], f64)> {
    let map = local_map(target, index, false, places)?;
    let origin = target.point(index);
    // The Jacobian of (u, v) by eight of the nine entries of the matrix, in the board's units around the marker.
    let shifted = map.matrix()
        * Matrix3::new(target.spacing_mm, 0.0, origin[0], 0.0, target.spacing_mm, origin[1], 0.0, 0.0, 1.0);
    let jacobian = |i: usize| {
        let p = target.point(i);
        let [x, y] = [(p[0] - origin[0]) / target.spacing_mm, (p[1] - origin[1]) / target.spacing_mm];
        let q = shifted * Vector3::new(x, y, 1.0);
        let (w, u, v) = (q.z / shifted[(2, 2)], q.x / q.z, q.y / q.z);
        SMatrix::<f64, 2, 8>::from_row_slice(&[
            x,
            y,
            1.0,
            0.0,
            0.0,
            0.0,
            -u * x,
            -u * y, //
            0.0,
            0.0,
            0.0,
            x,
            y,
            1.0,
            -v * x,
            -v * y,
        ]) / w
    };
    let mut normal = SMatrix::<f64, 8, 8>::zeros();
    for i in near(target, index, false, places.keys().copied()) {
        let rows = jacobian(i);
        normal += rows.transpose() * rows;
    }
    let row = jacobian(index);
    let solved = normal.cholesky()?.solve(&row.transpose());
    let factor = (1.0 + (row * solved).trace() / 2.0).sqrt();
    Some((map.apply(origin)?, factor))
}

#[cfg(test)]
mod tests {
    use depthcal_model::target::Pattern;

    use super::*;

    #[test]
    fn predictions_from_all_sides_are_better_than_those_from_one() {
        let pattern = Pattern::Charuco { marker_mm: 10.0, dictionary: "DICT_5X5_100".into() };
        let target = Target { pattern, columns: 8, rows: 8, spacing_mm: 20.0 };
        let seen = |i: usize| {
            let [x, y] = target.point(i);
            let w = 1.0 + 1e-3 * x + 5e-4 * y;
            [(2.0 * x + 30.0) / w, (1.8 * y + 20.0) / w]
        };
        let places = (0..target.len()).map(|i| (i, seen(i))).collect();
        for (index, range) in [(24, 1.0..1.2), (0, 1.5..6.0), (48, 1.5..6.0)] {
            let (predicted, factor) = prediction(&target, index, &places).expect("a map");
            assert!((predicted[0] - seen(index)[0]).hypot(predicted[1] - seen(index)[1]) < 1e-6);
            assert!(range.contains(&factor), "marker {index}: {factor}");
        }
    }
}
