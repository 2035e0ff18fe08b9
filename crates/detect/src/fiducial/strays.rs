//! Markers that do not lie where the markers around them predict them.

use std::collections::BTreeMap;

use depthcal_model::target::Target;

use super::neighbours::{near, prediction};
use crate::detection::Marker;

/// A marker is a stray when it is farther from its prediction than this many standard deviations of all markers.
const STRAY: f64 = 6.0;
/// Distance, px, that is always allowed: noise of a prediction from few neighbours.
const ALLOWED_PX: f64 = 0.4;
/// Distance, px, that is never allowed, unless most markers are as far off (a lens that bends the board within a few
/// squares).
const LIMIT_PX: f64 = 1.0;

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
    places.into_iter().map(|(index, pixel)| Marker { index, pixel }).collect()
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
}
