//! A pixel's own signal and that of its nearest neighbours.

/// Standard deviation of the Gaussian by which light is spread over the nearest pixels, px.
pub const NEAR_PX: f64 = 0.8;
/// The camera's own smoothing: the mean over 3×3 pixels, one to either side.
pub const OWN_REACH: usize = 1;
/// Pixels to either side that the spread light of the nearest pixels, smoothed as the own signal is, is summed over.
pub const NEAR_REACH: usize = 4;

/// Weights along a row or a column: the Gaussian of [`NEAR_PX`], cut off at three pixels, averaged over three positions. They sum
/// to
/// 1.
pub const NEAR_WEIGHTS: [f32; 2 * NEAR_REACH + 1] = [
    0.000_146_914,
    0.007_450_353,
    0.083_553_925,
    0.249_632_5,
    0.318_432_63,
    0.249_632_5,
    0.083_553_925,
    0.007_450_353,
    0.000_146_914,
];

/// Mean amplitude over 3×3 pixels, and over the nearest pixels with [`NEAR_WEIGHTS`] along both axes; beyond the image's border
/// the windows are cut off.
pub fn own_and_near(amplitude: &[u16], [width, height]: [usize; 2], [u, v]: [usize; 2]) -> (f32, f32) {
    let span =
        |center: usize, reach: usize, length: usize| center.saturating_sub(reach)..(center + reach + 1).min(length);
    let total = |center: usize, length: usize| -> f32 {
        span(center, NEAR_REACH, length).map(|i| NEAR_WEIGHTS[i + NEAR_REACH - center]).sum()
    };
    let (mut local, mut count, mut near) = (0.0_f32, 0_u32, 0.0_f32);
    let columns = span(u, NEAR_REACH, width);
    for row in span(v, NEAR_REACH, height) {
        let line = &amplitude[row * width..][..width];
        let taps = &NEAR_WEIGHTS[columns.start + NEAR_REACH - u..];
        let weighted = line[columns.clone()].iter().zip(taps).map(|(a, w)| w * f32::from(*a));
        near += NEAR_WEIGHTS[row + NEAR_REACH - v] * weighted.sum::<f32>();
        if row.abs_diff(v) <= OWN_REACH {
            let box_ = span(u, OWN_REACH, width);
            count += box_.len() as u32;
            local += line[box_].iter().map(|a| f32::from(*a)).sum::<f32>();
        }
    }
    (local / count as f32, near / (total(u, width) * total(v, height)))
}
