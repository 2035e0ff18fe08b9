//! Contrast stretching: 16-bit amplitudes mapped to a range in which the board has contrast.

use depthcal_io::GrayImage;

/// How grey values are mapped to [0, 1]. The ends are robust percentiles: in raw infrared amplitudes a lamp or a
/// reflection is tens of times brighter than the board and would set the scale.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Stretch {
    /// Linear between the percentiles.
    Linear,
    /// The square root: makes shot noise uniform, and keeps contrast in dark, distant boards.
    SquareRoot,
    /// The logarithm: equal ratios of reflectance have equal contrast under any illumination.
    Logarithm,
}

impl Stretch {
    /// The stretches to try for an image, the most successful first.
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

    /// Whether the image is small enough to be searched at twice its size as well, where small features are found that
    /// are missed otherwise.
    pub(crate) fn is_small(&self) -> bool {
        self.data.len() <= 1_500_000
    }

    /// The value at `pixel`, interpolated between the four pixels around it; `None` outside the image.
    pub(crate) fn between(&self, [u, v]: [f64; 2]) -> Option<f64> {
        let inside = u >= 0.0 && v >= 0.0 && u < self.width as f64 - 1.0 && v < self.height as f64 - 1.0;
        let (x, y) = (u as usize, v as usize);
        let (s, t) = (u - x as f64, v - y as f64);
        let value = |x: usize, y: usize| f64::from(self.data[y * self.width + x]);
        inside.then(|| {
            (1.0 - t) * ((1.0 - s) * value(x, y) + s * value(x + 1, y))
                + t * ((1.0 - s) * value(x, y + 1) + s * value(x + 1, y + 1))
        })
    }

    /// Enlarged to twice its size by cubic convolution (Keys 1981). Pixel u of the plane covers pixels 2 u and 2 u + 1.
    pub(crate) fn doubled(&self) -> Plane {
        // Weights of the neighbours −2 … 1 of a pixel a quarter before pixel 0.
        const WEIGHTS: [f32; 4] = [-0.023_437_5, 0.226_562_5, 0.867_187_5, -0.070_312_5];
        let (width, height) = (self.width, self.height);
        let doubled = |input: &[f32], size: usize, stride: usize, output: &mut [f32], out_stride: usize| {
            let value = |i: isize| input[i.clamp(0, size as isize - 1) as usize * stride];
            for i in 0..size {
                let (mut before, mut after) = (0.0, 0.0);
                for (k, weight) in WEIGHTS.iter().enumerate() {
                    let k = k as isize - 2;
                    before += weight * value(i as isize + k);
                    after += weight * value(i as isize - k);
                }
                output[2 * i * out_stride] = before;
                output[(2 * i + 1) * out_stride] = after;
            }
        };
        let mut wide = vec![0.0; 2 * width * height];
        for (input, output) in self.data.chunks_exact(width).zip(wide.chunks_exact_mut(2 * width)) {
            doubled(input, width, 1, output, 1);
        }
        let mut data = vec![0.0; 4 * width * height];
        for column in 0..2 * width {
            doubled(&wide[column..], height, 2 * width, &mut data[column..], 2 * width);
        }
        data.iter_mut().for_each(|v| *v = v.clamp(0.0, 1.0));
        Plane { width: 2 * width, height: 2 * height, data }
    }

    /// Quantised to 8 bits.
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        self.data.iter().map(|&v| (v * 255.0 + 0.5) as u8).collect()
    }
}

/// The 0.5 % and 99.5 % percentiles, at least one step apart.
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
}
