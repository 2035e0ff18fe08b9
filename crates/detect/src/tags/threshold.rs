//! A local threshold: which pixels are dark against their surroundings.

use crate::stretch::Plane;

/// Side of the tiles whose smallest and largest values are taken, px.
const TILE: usize = 4;
/// Least difference between the largest and the smallest value around a pixel, of the plane's range: less is paper, or ink.
const LEAST_CONTRAST: f32 = 0.05;

/// Whether each pixel is dark. The threshold lies `level` of the way from the smallest to the largest value of the 3 × 3 tiles
/// around a pixel, as in AprilTag's detector (Wang, Olson 2016, "AprilTag 2"). Where these hardly differ, nothing is dark.
pub(super) fn dark(plane: &Plane, level: f32) -> Vec<bool> {
    let (width, height) = (plane.width, plane.height);
    let (columns, rows) = (width.div_ceil(TILE), height.div_ceil(TILE));
    let mut tiles = vec![(f32::INFINITY, f32::NEG_INFINITY); columns * rows];
    for (y, line) in plane.data.chunks_exact(width).enumerate() {
        for (x, part) in line.chunks(TILE).enumerate() {
            let tile = &mut tiles[y / TILE * columns + x];
            for &value in part {
                *tile = (tile.0.min(value), tile.1.max(value));
            }
        }
    }
    let around = |x: usize, y: usize| {
        let mut range = (f32::INFINITY, f32::NEG_INFINITY);
        for v in y.saturating_sub(1)..(y + 2).min(rows) {
            for tile in &tiles[v * columns + x.saturating_sub(1)..v * columns + (x + 2).min(columns)] {
                range = (range.0.min(tile.0), range.1.max(tile.1));
            }
        }
        range
    };
    let thresholds: Vec<f32> = (0..columns * rows)
        .map(|i| {
            let (low, high) = around(i % columns, i / columns);
            if high - low < LEAST_CONTRAST { f32::NEG_INFINITY } else { low + level * (high - low) }
        })
        .collect();
    let mut dark = Vec::with_capacity(width * height);
    for (y, line) in plane.data.chunks_exact(width).enumerate() {
        for (x, part) in line.chunks(TILE).enumerate() {
            let threshold = thresholds[y / TILE * columns + x];
            dark.extend(part.iter().map(|value| *value < threshold));
        }
    }
    dark
}
