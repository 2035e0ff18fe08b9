//! How sharp an image is, told by the edges of the board.

use depthcal_io::{GrayImage, MarkerObservation};
use depthcal_model::Target;

/// Smallest and largest half side of the surroundings of a marker that are looked at, px.
const HALF_SIDE_PX: [f64; 2] = [3.0, 16.0];

/// Width of the board's edges, px: the contrast around a marker over the steepest slope there, in the median of the markers. A
/// sharp image has 1.5 to 3 px; blur by defocus or motion widens them. `None` where no marker has contrast.
pub fn edge_width_px(image: &GrayImage, target: &Target, markers: &[MarkerObservation]) -> Option<f64> {
    let half_side = half_side_px(target, markers)?;
    let mut widths: Vec<f64> = markers.iter().filter_map(|marker| width_near(image, marker.pixel, half_side)).collect();
    widths.sort_by(f64::total_cmp);
    widths.get(widths.len() / 2).copied()
}

/// Half of the distance of neighbouring markers in the image.
fn half_side_px(target: &Target, markers: &[MarkerObservation]) -> Option<f64> {
    let scales = markers.windows(2).filter_map(|pair| {
        let [a, b] = [pair[0], pair[1]].map(|marker| target.point(marker.index));
        let mm = (a[0] - b[0]).hypot(a[1] - b[1]);
        let px = (pair[0].pixel[0] - pair[1].pixel[0]).hypot(pair[0].pixel[1] - pair[1].pixel[1]);
        (mm > 0.0).then_some(px / mm)
    });
    let mut scales: Vec<f64> = scales.collect();
    scales.sort_by(f64::total_cmp);
    let px_per_mm = scales.get(scales.len() / 2)?;
    Some((0.5 * px_per_mm * target.spacing_mm).clamp(HALF_SIDE_PX[0], HALF_SIDE_PX[1]))
}

fn width_near(image: &GrayImage, [u, v]: [f64; 2], half_side: f64) -> Option<f64> {
    let range = |middle: f64, size: usize| {
        let low = (middle - half_side).ceil().max(1.0) as usize;
        let high = ((middle + half_side).floor().max(0.0) as usize).min(size.saturating_sub(2));
        low..=high
    };
    let value = |u: usize, v: usize| f64::from(image.data[v * image.width + u]);
    let (mut low, mut high, mut slope) = (f64::INFINITY, 0.0_f64, 0.0_f64);
    for row in range(v, image.height) {
        for column in range(u, image.width) {
            let middle = value(column, row);
            (low, high) = (low.min(middle), high.max(middle));
            let along = value(column + 1, row) - value(column - 1, row);
            let down = value(column, row + 1) - value(column, row - 1);
            slope = slope.max(along.hypot(down) / 2.0);
        }
    }
    (slope > 0.0 && high > low).then(|| (high - low) / slope)
}

#[cfg(test)]
mod tests {
    use depthcal_model::Pattern;

    use super::*;

    /// A chessboard of squares of 20 px whose edges are ramps of a given width.
    fn board(width_px: f64, light: f64) -> (GrayImage, Target, Vec<MarkerObservation>) {
        let (width, height) = (200, 160);
        // A wave of period 40 px that is cut to a trapezoid with flanks of the given width.
        let wave = |x: f64| {
            let phase = (x / 40.0).rem_euclid(1.0);
            let triangle = if phase < 0.5 { phase } else { 1.0 - phase } * 40.0 - 10.0;
            (2.0 * triangle / width_px).clamp(-1.0, 1.0)
        };
        let value = |i: usize| {
            let (u, v) = ((i % width) as f64, (i / width) as f64);
            (light * (120.0 + 80.0 * wave(u) * wave(v))) as u16
        };
        let data = (0..width * height).map(value).collect();
        let target = Target { pattern: Pattern::Chessboard, columns: 6, rows: 4, spacing_mm: 25.0 };
        let marker = |index: usize| {
            let [column, row] = [index % 6, index / 6];
            let pixel = [50.0 + 20.0 * column as f64, 50.0 + 20.0 * row as f64];
            MarkerObservation { index, pixel, std_px: 1.0 }
        };
        (GrayImage { width, height, data, bits: 8 }, target, (0..24).map(marker).collect())
    }

    /// The widths are those of the ramps, to the quarter that differences over two pixels cost, and do not depend on the light.
    #[test]
    fn the_width_is_that_of_the_ramps() {
        for width in [4.0, 8.0, 12.0] {
            let (image, target, markers) = board(width, 1.0);
            let bright = edge_width_px(&image, &target, &markers).unwrap();
            assert!((bright / width - 1.0).abs() < 0.3, "{bright} {width}");
            let (image, ..) = board(width, 0.5);
            let dark = edge_width_px(&image, &target, &markers).unwrap();
            assert!((dark / bright - 1.0).abs() < 0.05, "{dark} {bright}");
        }
    }

    #[test]
    fn no_contrast_and_markers_at_the_border_are_no_panic() {
        let (mut image, target, mut markers) = board(4.0, 1.0);
        markers[0].pixel = [0.0, 0.0];
        markers[23].pixel = [199.0, 159.0];
        assert!(edge_width_px(&image, &target, &markers).is_some());
        image.data.fill(7);
        assert_eq!(edge_width_px(&image, &target, &markers), None);
        assert_eq!(edge_width_px(&image, &target, &[]), None);
    }
}
