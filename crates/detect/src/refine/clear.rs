//! Refined markers taken into a detection, without those that something else obscures.

use super::marker::RefinedMarker;
use crate::detection::{Detection, Marker};

/// A marker with this many times the median scatter about the model is unclear: something else is visible there, a
/// reflection, dirt or a finger.
const UNCLEAR: f64 = 4.0;
/// Scatter, relative to the contrast, at or below which a marker is always clear.
const ORDINARY_NOISE: f64 = 0.06;
/// Least share of clear markers for the unclear ones to be dropped.
const CLEAR_PART: f64 = 0.75;

/// Moves markers to their refined positions and drops the unclear ones; when too many are unclear, none is dropped.
pub(crate) fn keep_clear(detection: &mut Detection, refined: &[RefinedMarker]) {
    let mut noise: Vec<f64> = refined.iter().map(|r| r.relative_noise).collect();
    noise.sort_by(f64::total_cmp);
    let limit = noise.get(noise.len() / 2).map_or(0.0, |median| (UNCLEAR * median).max(ORDINARY_NOISE));
    let clear: Vec<RefinedMarker> = refined.iter().filter(|r| r.relative_noise <= limit).copied().collect();
    if (clear.len() as f64) < CLEAR_PART * detection.markers.len() as f64 {
        take_over(detection, refined);
        return;
    }
    detection.markers = clear.iter().map(|r| Marker { index: r.index, pixel: r.pixel }).collect();
}

/// Moves markers to their refined positions; markers that were not refined stay as they are.
pub(crate) fn take_over(detection: &mut Detection, refined: &[RefinedMarker]) {
    for r in refined {
        if let Ok(index) = detection.markers.binary_search_by_key(&r.index, |m| m.index) {
            detection.markers[index].pixel = r.pixel;
        }
    }
}
