//! The infrared amplitude around pixels.

use std::sync::LazyLock;

/// Standard deviation of the Gaussian that weights the amplitude around a pixel, px.
pub const SURROUND_PX: f64 = 2.0;
/// Reach of the Gaussian window to either side, px.
const REACH: usize = 4;
const TAPS: usize = 2 * REACH + 1;

static WEIGHTS: LazyLock<[f64; TAPS]> = LazyLock::new(|| {
    const SPREAD: f64 = 1.0 / (2.0 * SURROUND_PX * SURROUND_PX);
    std::array::from_fn(|i| (-(i as f64 - REACH as f64).powi(2) * SPREAD).exp())
});

/// Gaussian mean of the amplitude around every pixel of a part of an image, and the slope of its logarithm, see
/// [`Context::surround`](crate::Context::surround). The window is separable: rows first, then columns.
#[derive(Debug)]
pub struct Surroundings {
    low: [usize; 2],
    columns: usize,
    /// (mean, slope along u, slope along v) row by row.
    values: Vec<[f64; 3]>,
}

impl Surroundings {
    /// Of the pixels from `low` to `high` (column, row, both included), which must lie in the image of `width` × `height`
    /// amplitudes, row by row. Beyond the image's border the window is cut off.
    pub fn of(amplitude: &[u16], [width, height]: [usize; 2], low: [usize; 2], high: [usize; 2]) -> Self {
        let w = &*WEIGHTS;
        let columns = high[0] - low[0] + 1;
        let first = low[1].saturating_sub(REACH);
        let last = (high[1] + REACH).min(height - 1);
        // Of every row: the weighted sum, and its first moment along u.
        let mut rows: Vec<[f64; 2]> = Vec::with_capacity(columns * (last - first + 1));
        for v in first..=last {
            let line = &amplitude[v * width..][..width];
            for u in low[0]..=high[0] {
                let (from, to) = (u.saturating_sub(REACH), (u + REACH).min(width - 1));
                let (mut sum, mut moment) = (0.0, 0.0);
                for (i, value) in line[from..=to].iter().enumerate() {
                    let tap = from + i + REACH - u;
                    let weighted = w[tap] * f64::from(*value);
                    sum += weighted;
                    moment += weighted * (tap as f64 - REACH as f64);
                }
                rows.push([sum, moment]);
            }
        }
        let total = |center: usize, size: usize| -> f64 {
            let (from, to) = (center.saturating_sub(REACH), (center + REACH).min(size - 1));
            (from..=to).map(|i| w[i + REACH - center]).sum()
        };
        let across: Vec<f64> = (low[0]..=high[0]).map(|u| total(u, width)).collect();
        let mut values = Vec::with_capacity(columns * (high[1] - low[1] + 1));
        for v in low[1]..=high[1] {
            let down = total(v, height);
            let (from, to) = (v.saturating_sub(REACH), (v + REACH).min(height - 1));
            for (u, across) in across.iter().enumerate() {
                let (mut sum, mut moment) = (0.0, [0.0; 2]);
                for row in from..=to {
                    let tap = row + REACH - v;
                    let [s, m] = rows[(row - first) * columns + u];
                    sum += w[tap] * s;
                    moment[0] += w[tap] * m;
                    moment[1] += w[tap] * s * (tap as f64 - REACH as f64);
                }
                let slope = slope(moment, sum);
                values.push([sum / (across * down), slope[0], slope[1]]);
            }
        }
        Self { low, columns, values }
    }

    /// Mean around a pixel of the part, and the slope of its logarithm along u and v, 1/px.
    pub fn at(&self, u: usize, v: usize) -> (f64, [f64; 2]) {
        let [mean, along, across] = self.values[(v - self.low[1]) * self.columns + u - self.low[0]];
        (mean, [along, across])
    }
}

/// The values of [`Surroundings::at`] for a single pixel (u, v), which must lie in the image.
pub fn mean_and_slope(amplitude: &[u16], [width, height]: [usize; 2], [u, v]: [usize; 2]) -> (f64, [f64; 2]) {
    let w = &*WEIGHTS;
    // Of either axis: first and last pixel of the window.
    let [(left, right), (top, bottom)] =
        [(u, width), (v, height)].map(|(center, size)| (center.saturating_sub(REACH), (center + REACH).min(size - 1)));
    let (mut total, mut sum, mut moment) = (0.0, 0.0, [0.0; 2]);
    for row in top..=bottom {
        let (mut of_row, mut weighted, mut along) = (0.0, 0.0, 0.0);
        for (i, value) in amplitude[row * width..][left..=right].iter().enumerate() {
            let tap = left + i + REACH - u;
            let product = w[tap] * f64::from(*value);
            of_row += w[tap];
            weighted += product;
            along += product * (tap as f64 - REACH as f64);
        }
        let tap = row + REACH - v;
        total += w[tap] * of_row;
        sum += w[tap] * weighted;
        moment[0] += w[tap] * along;
        moment[1] += w[tap] * weighted * (tap as f64 - REACH as f64);
    }
    (sum / total, slope(moment, sum))
}

/// The derivative of the logarithm of a Gaussian mean: the first moment over the variance and the sum.
fn slope(moment: [f64; 2], sum: f64) -> [f64; 2] {
    moment.map(|m| if sum > 0.0 { m / (sum * SURROUND_PX * SURROUND_PX) } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sums over the window as the definition has them, at pixels in the middle, at a border and in corners.
    #[test]
    fn the_separable_window_is_the_window() {
        let (width, height) = (23, 17);
        let data: Vec<u16> = (0..width * height).map(|i| (i * 7919 % 251 + 3) as u16).collect();
        let part = Surroundings::of(&data, [width, height], [0, 0], [width - 1, height - 1]);
        for [u, v] in [[0, 0], [11, 8], [22, 16], [3, 16], [22, 5]] {
            let (mut total, mut sum, mut moment) = (0.0, 0.0, [0.0; 2]);
            for dv in -4_i64..=4 {
                for du in -4_i64..=4 {
                    let (x, y) = (u as i64 + du, v as i64 + dv);
                    if x < 0 || y < 0 || x >= width as i64 || y >= height as i64 {
                        continue;
                    }
                    let w = (-((du * du + dv * dv) as f64) / (2.0 * SURROUND_PX * SURROUND_PX)).exp();
                    let value = w * f64::from(data[y as usize * width + x as usize]);
                    (total, sum) = (total + w, sum + value);
                    moment = [moment[0] + value * du as f64, moment[1] + value * dv as f64];
                }
            }
            let expected = [sum / total, moment[0] / (sum * 4.0), moment[1] / (sum * 4.0)];
            for (mean, slope) in [part.at(u, v), mean_and_slope(&data, [width, height], [u, v])] {
                let got = [mean, slope[0], slope[1]];
                assert!(got.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{u}, {v}: {got:?} {expected:?}");
            }
        }
    }
}
