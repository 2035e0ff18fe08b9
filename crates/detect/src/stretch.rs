//! Grey values for the eyes of a detector: 16-bit amplitudes brought into a range where the board has contrast.

use depthcal_io::GrayImage;

use opencv::core::{Mat, Point2f, Size};
use opencv::imgproc;

use crate::error::{Context, DetectError};

/// How grey values are brought to [0, 1]. The ends are robust percentiles, so that a lamp or a reflex, which in raw
/// infrared amplitudes is tens of times brighter than the board, does not set the scale.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Stretch {
    /// Straight between the percentiles.
    Linear,
    /// The square root: about equal noise everywhere when photons count, and near boards do not drown far ones.
    SquareRoot,
    /// The logarithm: equal contrast for equal ratio of reflectances, whatever the illumination.
    Logarithm,
}

impl Stretch {
    /// The stretches worth trying for an image, the most successful first.
    pub(crate) fn candidates(image: &GrayImage) -> &'static [Stretch] {
        if image.bits > 8 {
            &[Stretch::SquareRoot, Stretch::Logarithm, Stretch::Linear]
        } else {
            &[Stretch::Linear, Stretch::SquareRoot]
        }
    }
}

/// Grey values in [0, 1], row-major.
#[derive(Debug, Clone)]
pub(crate) struct Plane {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) data: Vec<f32>,
}

impl Plane {
    /// Stretches an image.
    pub(crate) fn stretched(image: &GrayImage, stretch: Stretch) -> Plane {
        let (low, high) = percentiles(&image.data);
        let curve = |v: u16| -> f32 {
            let v = f32::from(v);
            match stretch {
                Stretch::Linear => v,
                Stretch::SquareRoot => v.sqrt(),
                Stretch::Logarithm => (v + 1.0).ln(),
            }
        };
        let (bottom, top) = (curve(low), curve(high));
        let scale = 1.0 / (top - bottom).max(f32::MIN_POSITIVE);
        let data = image.data.iter().map(|&v| ((curve(v) - bottom) * scale).clamp(0.0, 1.0)).collect();
        Plane { width: image.width, height: image.height, data }
    }

    /// As 8 bits for OpenCV, at `scale` times the size.
    pub(crate) fn to_mat(&self, scale: usize) -> Result<Mat, DetectError> {
        let bytes = self.to_bytes();
        let mat = Mat::new_rows_cols_with_data(self.height as i32, self.width as i32, &bytes).context("Mat")?;
        let mut scaled = Mat::default();
        let size = Size::new((self.width * scale) as i32, (self.height * scale) as i32);
        imgproc::resize(&mat, &mut scaled, size, 0.0, 0.0, imgproc::INTER_CUBIC).context("resize")?;
        Ok(scaled)
    }

    /// Whether it is worth looking at the image at twice its size: small features are not found otherwise.
    pub(crate) fn is_small(&self) -> bool {
        self.data.len() <= 1_500_000
    }

    /// Quantised to 8 bits.
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        self.data.iter().map(|&v| (v * 255.0 + 0.5) as u8).collect()
    }
}

/// Coordinates in an image from those in its enlargement.
pub(crate) fn unscaled(pixel: Point2f, scale: usize) -> [f64; 2] {
    [pixel.x, pixel.y].map(|v| (f64::from(v) + 0.5) / scale as f64 - 0.5)
}

/// Checks that an image is what its header says.
pub(crate) fn check(image: &GrayImage) -> Result<(), DetectError> {
    let expected = image.width.checked_mul(image.height);
    if image.width == 0 || image.height == 0 || expected != Some(image.data.len()) {
        return Err(DetectError::ImageSize { width: image.width, height: image.height, got: image.data.len() });
    }
    Ok(())
}

/// The 0.5 % and 99.5 % percentiles; apart by at least one step.
fn percentiles(values: &[u16]) -> (u16, u16) {
    let mut histogram = vec![0usize; 1 << 16];
    for &v in values {
        histogram[usize::from(v)] += 1;
    }
    let tail = values.len() / 200;
    let reach = |levels: &mut dyn Iterator<Item = u16>| {
        let mut seen = 0;
        for level in levels {
            seen += histogram[usize::from(level)];
            if seen > tail {
                return level;
            }
        }
        0
    };
    let low = reach(&mut (0..=u16::MAX));
    let high = reach(&mut (0..=u16::MAX).rev());
    (low, high.max(low.saturating_add(1)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lamp_does_not_set_the_scale() {
        let mut data: Vec<u16> = (0..10_000).map(|i| 1000 + i % 100).collect();
        data[17] = 65_535;
        let image = GrayImage { width: 100, height: 100, data, bits: 16 };
        let plane = Plane::stretched(&image, Stretch::SquareRoot);
        let spread = plane.data.iter().filter(|v| **v > 0.2 && **v < 0.8).count();
        assert!(spread > 5000, "{spread} of 10000 values are in the middle of the range");
    }

    #[test]
    fn a_constant_image_is_stretched_without_nan() {
        for value in [0, 7, 65_535] {
            let image = GrayImage { width: 8, height: 8, data: vec![value; 64], bits: 16 };
            for stretch in [Stretch::Linear, Stretch::SquareRoot, Stretch::Logarithm] {
                assert!(Plane::stretched(&image, stretch).data.iter().all(|v| v.is_finite()));
            }
        }
    }

    #[test]
    fn a_truncated_image_is_refused() {
        let image = GrayImage { width: 8, height: 8, data: vec![0; 63], bits: 8 };
        assert!(matches!(check(&image), Err(DetectError::ImageSize { got: 63, .. })));
    }
}
