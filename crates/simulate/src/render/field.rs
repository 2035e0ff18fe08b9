//! Fields over the image: Gaussian blur, and spatially correlated noise.

use rand::{Rng, RngExt};
use rand_distr::StandardNormal;
use rayon::prelude::*;

/// Blurs `field` (row-major) with a Gaussian of standard deviation `sigma` px; at the borders the weights are
/// renormalised.
pub(crate) fn blur(field: &[f32], width: usize, sigma: f64) -> Vec<f32> {
    let Some(kernel) = kernel(sigma) else { return field.to_vec() };
    let height = field.len() / width.max(1);
    let along_rows =
        filter(field, width, |row, i| row + i, &kernel, |index| (index / width * width, index % width, width));
    filter(&along_rows, width, |column, i| column + i * width, &kernel, |index| (index % width, index / width, height))
}

/// Noise of mean 0 and variance 1: white noise filtered with a Gaussian of standard deviation `sigma` px.
pub(crate) fn correlated(width: usize, height: usize, sigma: f64, rng: &mut impl Rng) -> Vec<f32> {
    let Some(kernel) = kernel(sigma) else {
        return (0..width * height).map(|_| rng.sample(StandardNormal)).collect();
    };
    // The white noise extends beyond the borders, which makes the variance uniform.
    let reach = kernel.len() / 2;
    let (wide, high) = (width + 2 * reach, height + 2 * reach);
    let white: Vec<f32> = (0..wide * high).map(|_| rng.sample(StandardNormal)).collect();
    let filtered = blur(&white, wide, sigma);
    let power: f32 = kernel.iter().map(|k| k * k).sum();
    let inner = |row: usize| &filtered[(row + reach) * wide + reach..(row + reach) * wide + reach + width];
    (0..height).flat_map(|row| inner(row).iter().map(|value| value / power)).collect()
}

fn kernel(sigma: f64) -> Option<Vec<f32>> {
    if sigma <= 0.0 {
        return None;
    }
    let reach = (4.0 * sigma).ceil() as i32;
    let weights: Vec<f64> = (-reach..=reach).map(|i| (-0.5 * (f64::from(i) / sigma).powi(2)).exp()).collect();
    let sum: f64 = weights.iter().sum();
    Some(weights.iter().map(|w| (w / sum) as f32).collect())
}

/// Filters along one direction. `line` maps an index to the start of its line, its place in the line and the line's
/// length;
/// `step` maps a line's start and a place to an index.
fn filter(
    field: &[f32],
    width: usize,
    step: impl Fn(usize, usize) -> usize + Sync,
    kernel: &[f32],
    line: impl Fn(usize) -> (usize, usize, usize) + Sync,
) -> Vec<f32> {
    let reach = kernel.len() / 2;
    let mut out = vec![0.0f32; field.len()];
    out.par_chunks_mut(width).enumerate().for_each(|(row, values)| {
        for (column, value) in values.iter_mut().enumerate() {
            let (start, place, length) = line(row * width + column);
            let (first, last) = (place.saturating_sub(reach), (place + reach).min(length - 1));
            let (mut sum, mut weight) = (0.0f32, 0.0f32);
            for i in first..=last {
                let k = kernel[i + reach - place];
                sum += k * field[step(start, i)];
                weight += k;
            }
            *value = sum / weight;
        }
    });
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::streams::{Purpose, stream};

    #[test]
    fn correlated_noise_has_unit_variance_and_the_correlation_of_its_filter() {
        let (width, height) = (400, 300);
        let field = correlated(width, height, 1.3, &mut stream(1, Purpose::DepthNoise, 0));
        let products = |shift: usize| {
            let rows = (0..height).flat_map(|v| (0..width - shift).map(move |u| v * width + u));
            let values: Vec<f64> = rows.map(|i| f64::from(field[i]) * f64::from(field[i + shift])).collect();
            values.iter().sum::<f64>() / values.len() as f64
        };
        assert!((products(0) - 1.0).abs() < 0.05, "{}", products(0));
        // Two Gaussians of σ convolved: exp(−d² / 4σ²).
        for shift in [1, 2, 3] {
            let expected = (-((shift * shift) as f64) / (4.0 * 1.69)).exp();
            assert!((products(shift) - expected).abs() < 0.05, "{shift}: {} {expected}", products(shift));
        }
    }

    #[test]
    fn blur_keeps_constants_and_sums() {
        assert!(blur(&[0.25; 63], 9, 0.7).iter().all(|v| (v - 0.25).abs() < 1e-6));
        let mut spike = vec![0.0; 441];
        spike[220] = 1.0;
        let blurred = blur(&spike, 21, 0.9);
        assert!((blurred.iter().sum::<f32>() - 1.0).abs() < 1e-5);
        assert!((blurred[221] - blurred[241]).abs() < 1e-6);
    }
}
