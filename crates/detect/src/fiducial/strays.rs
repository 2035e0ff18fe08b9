//! Markers that do not lie where the markers around them predict them or, where there are none, where a smooth map of the whole
//! board does.

use std::collections::BTreeMap;

use depthcal_model::target::Target;

use super::neighbours::{near, prediction};
use crate::detection::Marker;
use crate::geometry::BoardMap;

/// A marker is a stray when it is farther from its prediction than this many standard deviations of all markers.
const STRAY: f64 = 6.0;
/// Distance, px, that is always allowed: noise of a prediction from few neighbours.
const ALLOWED_PX: f64 = 0.4;
/// Distance, px, that is never allowed, unless most markers are as far off (a lens that bends the board within a few
/// squares).
const LIMIT_PX: f64 = 1.0;

/// A marker without others around it is a stray when it is farther from the map of the whole board than this many standard
/// deviations: a polynomial is not a lens, and a right marker of its own is worth less than a wrong one costs.
const ALONE: f64 = 10.0;

/// Leaves out strays. A stray spoils the predictions of its neighbours too: in every round only those markers are
/// left out that are farther off than all their neighbours.
pub(super) fn without_strays(markers: Vec<Marker>, target: &Target) -> Vec<Marker> {
    let mut places: BTreeMap<usize, [f64; 2]> = markers.iter().map(|m| (m.index, m.pixel)).collect();
    let distance = |index: usize, places: &BTreeMap<usize, [f64; 2]>| {
        let (predicted, factor) = prediction(target, index, places)?;
        let pixel = places.get(&index)?;
        // A prediction from one side only is not held against a marker as much as one from all sides.
        Some((predicted[0] - pixel[0]).hypot(predicted[1] - pixel[1]) / factor)
    };
    loop {
        let far: BTreeMap<usize, f64> = places.keys().filter_map(|&i| Some((i, distance(i, &places)?))).collect();
        let mut sorted: Vec<f64> = far.values().copied().collect();
        sorted.sort_by(f64::total_cmp);
        let Some(&median) = sorted.get(sorted.len() / 2) else { break };
        // The median of the distances of a normal distribution in the plane is 1.18 standard deviations of a coordinate.
        let limit = (STRAY * median / 1.18).clamp(ALLOWED_PX, LIMIT_PX.max(2.0 * median));
        let strays: Vec<usize> = far
            .iter()
            .filter(|(_, d)| **d > limit)
            .filter(|(i, d)| {
                let neighbours = near(target, **i, false, far.keys().copied());
                neighbours.iter().all(|n| far[n] <= **d)
            })
            .map(|(i, _)| *i)
            .collect();
        if strays.is_empty() {
            break;
        }
        places.retain(|i, _| !strays.contains(i));
    }
    while let Some(stray) = worst_alone(&places, target) {
        places.remove(&stray);
    }
    places.into_iter().map(|(index, pixel)| Marker { index, pixel }).collect()
}

/// Of the markers that no others predict, the one that is farthest off the map of all others, if it is a stray. A tag that is
/// cut off by the image border, or read where there is none, puts such a marker anywhere.
fn worst_alone(places: &BTreeMap<usize, [f64; 2]>, target: &Target) -> Option<usize> {
    let distance = |map: &BoardMap, index: usize| {
        let ([u, v], pixel) = (map.apply(target.point(index))?, places[&index]);
        Some((u - pixel[0]).hypot(v - pixel[1]))
    };
    let deviations = |index: usize| {
        let others = || places.keys().copied().filter(move |other| *other != index);
        let map = BoardMap::fit(&others().map(|other| (target.point(other), places[&other])).collect::<Vec<_>>())?;
        let off = distance(&map, index)? / map.leverage(target.point(index))?;
        let mut usual: Vec<f64> = others().filter_map(|other| distance(&map, other)).collect();
        usual.sort_by(f64::total_cmp);
        let sigma = usual.get(usual.len() / 2)? / 1.18;
        (off > LIMIT_PX).then_some(off / sigma.max(f64::MIN_POSITIVE))
    };
    let alone = places.keys().copied().filter(|index| prediction(target, *index, places).is_none());
    let worst = alone.filter_map(|index| Some((deviations(index)?, index))).max_by(|a, b| a.0.total_cmp(&b.0));
    worst.filter(|(deviation, _)| *deviation > ALONE).map(|(_, index)| index)
}

#[cfg(test)]
mod tests {
    use depthcal_model::target::Pattern;

    use super::*;

    fn board() -> Target {
        let pattern = Pattern::Charuco { marker_mm: 10.0, dictionary: "DICT_5X5_100".into() };
        Target { pattern, columns: 8, rows: 7, spacing_mm: 20.0 }
    }

    fn seen(target: &Target) -> Vec<Marker> {
        (0..target.len())
            .map(|index| {
                let [x, y] = target.point(index);
                let w = 1.0 + 1e-3 * x;
                // A few hundredths of a pixel of noise.
                let noise = 0.03 * (index as f64 * 2.3).sin();
                Marker { index, pixel: [(2.0 * x + 30.0) / w + noise, (1.8 * y + 20.0) / w - noise] }
            })
            .collect()
    }

    #[test]
    fn a_displaced_marker_is_left_out_and_its_neighbours_are_kept() {
        let target = board();
        let all = seen(&target);
        assert_eq!(without_strays(all.clone(), &target), all);
        for wrong in [0, 17, 41] {
            let mut markers = all.clone();
            markers[wrong].pixel[1] += 1.3;
            let consistent = without_strays(markers, &target);
            assert_eq!(consistent.len(), all.len() - 1);
            assert!(consistent.iter().all(|m| m.index != wrong));
        }
    }
    /// As a wide lens sees the board, f = 400 px, k1 = −0.1.
    fn through_a_lens(target: &Target) -> Vec<Marker> {
        let bent = |m: Marker| {
            let [x, y] = [(m.pixel[0] - 180.0) / 400.0, (m.pixel[1] - 140.0) / 400.0];
            let k = 400.0 * (1.0 - 0.1 * (x * x + y * y));
            Marker { pixel: [k * x + 180.0, k * y + 140.0], ..m }
        };
        seen(target).into_iter().map(bent).collect()
    }

    #[test]
    fn a_marker_without_others_around_it_is_held_against_the_whole_board() {
        let target = Target { columns: 14, rows: 9, ..board() };
        // Rows 0 to 3, the right of the others, and single corners between: as where tags beside are hidden.
        let is_seen = |index: usize| index / 13 < 4 || index % 13 > 9 || [78, 81, 84].contains(&index);
        let all: Vec<Marker> = through_a_lens(&target).into_iter().filter(|m| is_seen(m.index)).collect();
        assert_eq!(without_strays(all.clone(), &target), all);
        for wrong in [78, 81, 84] {
            let mut markers = all.clone();
            let marker = markers.iter_mut().find(|m| m.index == wrong).unwrap();
            // Half a square.
            marker.pixel[0] -= 12.0;
            marker.pixel[1] += 9.0;
            let consistent = without_strays(markers, &target);
            assert_eq!(consistent.len(), all.len() - 1);
            assert!(consistent.iter().all(|m| m.index != wrong));
        }
    }
}
