//! Scores of every image of a stream, on a small copy: how sharp it is, and how much it differs from the one before.

use depthcal_io::GrayImage;

/// Width of the small copy, px.
const SMALL: usize = 320;

/// Sides of the thumbnail by which images without a known board are told apart.
pub(crate) const THUMBNAIL: [usize; 2] = [16, 12];

/// Measures of an image.
#[derive(Debug, Clone)]
pub(crate) struct Score {
    /// Mean square of the differences of neighbours, over the square of the contrast: falls with blur, not with light.
    pub sharpness: f64,
    /// Mean absolute difference from the image before, over the contrast; infinite of the first.
    pub motion: f64,
    /// Mean brightness of tiles over the mean of the image.
    pub thumbnail: Vec<f32>,
}

/// Measures images one after the other.
#[derive(Debug, Default)]
pub(crate) struct Scorer {
    before: Option<(usize, usize, Vec<f32>)>,
}

impl Scorer {
    pub fn score(&mut self, image: &GrayImage) -> Score {
        let (width, height, small) = reduced(image);
        let n = small.len().max(1) as f64;
        let mean = small.iter().map(|v| f64::from(*v)).sum::<f64>() / n;
        let variance = small.iter().map(|v| (f64::from(*v) - mean).powi(2)).sum::<f64>() / n;
        let contrast = variance.sqrt().max(1e-6);
        // Sharpness needs the image itself: reduction hides blur. Differences of two pixels' distance, on every second row.
        let mut edges = 0.0;
        let mut count = 0_usize;
        for row in image.data.chunks_exact(image.width.max(1)).step_by(2) {
            for pair in row.windows(3) {
                let d = f64::from(pair[2]) - f64::from(pair[0]);
                edges += d * d;
            }
            count += row.len().saturating_sub(2);
        }
        let sharpness = edges / count.max(1) as f64 / variance.max(1e-6);
        let motion = match &self.before {
            Some((w, h, before)) if (*w, *h) == (width, height) => {
                let sum: f64 = small.iter().zip(before).map(|(a, b)| f64::from((a - b).abs())).sum();
                sum / n / contrast
            }
            _ => f64::INFINITY,
        };
        let thumbnail = tiles(&small, width, height, mean);
        self.before = Some((width, height, small));
        Score { sharpness, motion, thumbnail }
    }
}

/// The image reduced by a whole factor, by means.
fn reduced(image: &GrayImage) -> (usize, usize, Vec<f32>) {
    let factor = image.width.div_ceil(SMALL).max(1);
    let (width, height) = (image.width / factor, image.height / factor);
    let mut small = vec![0.0_f32; width * height];
    for v in 0..height * factor {
        let row = &image.data[v * image.width..][..width * factor];
        let out = &mut small[v / factor * width..][..width];
        for (sum, block) in out.iter_mut().zip(row.chunks_exact(factor)) {
            *sum += block.iter().map(|v| f32::from(*v)).sum::<f32>();
        }
    }
    let area = (factor * factor) as f32;
    small.iter_mut().for_each(|v| *v /= area);
    (width, height, small)
}

fn tiles(small: &[f32], width: usize, height: usize, mean: f64) -> Vec<f32> {
    let [columns, rows] = THUMBNAIL;
    let mut sums = vec![(0.0_f32, 0_u32); columns * rows];
    for (i, value) in small.iter().enumerate() {
        let (u, v) = (i % width, i / width);
        let (sum, count) = &mut sums[v * rows / height * columns + u * columns / width];
        *sum += value;
        *count += 1;
    }
    sums.into_iter().map(|(sum, count)| sum / count.max(1) as f32 / mean.max(1e-6) as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stripes(period: usize, shift: usize, blur: usize) -> GrayImage {
        let (width, height) = (640, 48);
        let raw = |u: usize| if ((u + shift) / period).is_multiple_of(2) { 200_u32 } else { 40 };
        let value = |u: usize| ((0..=2 * blur).map(|k| raw(u + k)).sum::<u32>() / (2 * blur as u32 + 1)) as u16;
        GrayImage { width, height, data: (0..width * height).map(|i| value(i % width)).collect(), bits: 8 }
    }

    #[test]
    fn blur_and_motion_show() {
        let mut scorer = Scorer::default();
        let sharp = scorer.score(&stripes(32, 0, 0));
        let still = scorer.score(&stripes(32, 0, 0));
        let moved = scorer.score(&stripes(32, 8, 0));
        let blurred = scorer.score(&stripes(32, 8, 6));
        assert!(sharp.motion.is_infinite() && still.motion == 0.0 && moved.motion > 0.2, "{moved:?}");
        assert!(blurred.sharpness < 0.5 * sharp.sharpness);
        // Half the light, the same sharpness.
        let mut dark = stripes(32, 0, 0);
        dark.data.iter_mut().for_each(|v| *v /= 2);
        let dark = scorer.score(&dark);
        assert!((dark.sharpness / sharp.sharpness - 1.0).abs() < 0.01);
        assert_eq!(dark.thumbnail.len(), 192);
    }
}
