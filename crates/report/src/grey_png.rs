//! Small grey pictures as PNG.

use std::io::Write;

use flate2::Compression;
use flate2::write::ZlibEncoder;

use depthcal_io::GrayImage;
use depthcal_statistics::quantile_of_sorted;

/// Grey levels are written in so many bits: enough to recognise a board by.
const BITS: usize = 4;

/// A picture, row by row, of values from 0 (black) to 1.
#[derive(Debug, Clone)]
pub(super) struct Picture {
    pub width: usize,
    pub height: usize,
    pub values: Vec<f64>,
}

impl Picture {
    /// An image, averaged over squares so that it is at most `widest` px wide, and stretched from its 1 % to its 99 % quantile.
    pub(super) fn of(image: &GrayImage, widest: usize) -> Self {
        let step = image.width.div_ceil(widest).max(1);
        let (width, height) = (image.width / step, image.height / step);
        let mean = |column: usize, row: usize| {
            let pixels = (0..step * step).map(|i| (row * step + i / step) * image.width + column * step + i % step);
            pixels.map(|pixel| f64::from(image.data[pixel])).sum::<f64>() / (step * step) as f64
        };
        let mut values: Vec<f64> = (0..width * height).map(|i| mean(i % width, i / width)).collect();
        let mut sorted = values.clone();
        sorted.sort_by(f64::total_cmp);
        let [low, high] = [0.01, 0.99].map(|q| quantile_of_sorted(&sorted, q));
        let span = (high - low).max(f64::MIN_POSITIVE);
        values.iter_mut().for_each(|value| *value = ((*value - low) / span).clamp(0.0, 1.0));
        Self { width, height, values }
    }

    /// The picture as PNG (ISO/IEC 15948); `None` where it has no pixels.
    pub(super) fn png(&self) -> Option<Vec<u8>> {
        if self.values.is_empty() {
            return None;
        }
        let most = f64::from((1_u32 << BITS) - 1);
        let mut rows = ZlibEncoder::new(Vec::new(), Compression::best());
        for row in self.values.chunks(self.width) {
            let mut line = vec![0_u8; 1 + (row.len() * BITS).div_ceil(8)];
            for (i, value) in row.iter().enumerate() {
                let level = (value * most).round() as u8;
                line[1 + i * BITS / 8] |= level << (8 - BITS - i * BITS % 8);
            }
            rows.write_all(&line).ok()?;
        }
        let [width, height] = [self.width, self.height].map(|size| (size as u32).to_be_bytes());
        // Grey, not interlaced.
        let head = [width.as_slice(), &height, &[BITS as u8, 0, 0, 0, 0]].concat();
        let mut png = b"\x89PNG\r\n\x1a\n".to_vec();
        for (kind, data) in [(b"IHDR", head), (b"IDAT", rows.finish().ok()?), (b"IEND", Vec::new())] {
            let body = [kind.as_slice(), &data].concat();
            let mut checksum = flate2::Crc::new();
            checksum.update(&body);
            png.extend((data.len() as u32).to_be_bytes());
            png.extend(body);
            png.extend(checksum.sum().to_be_bytes());
        }
        Some(png)
    }
}

#[cfg(test)]
mod tests {
    use depthcal_io::read_gray;

    use super::*;

    /// The project's own reader gives back what was written, to the levels that there are.
    #[test]
    fn pictures_are_read_as_they_were_written() {
        let data: Vec<u16> = (0..33 * 20).map(|i| (i % 33) as u16 * 100).collect();
        let image = GrayImage { width: 33, height: 20, data, bits: 16 };
        let picture = Picture::of(&image, 33);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("picture.png");
        std::fs::write(&path, picture.png().unwrap()).unwrap();
        let read = read_gray(&path).unwrap();
        assert_eq!((read.width, read.height), (33, 20));
        for (i, value) in picture.values.iter().enumerate() {
            assert!((f64::from(read.data[i]) / 255.0 - value).abs() < 0.04, "pixel {i}: {} for {value}", read.data[i]);
        }
        assert_eq!(Picture::of(&image, 11).width, 11);
    }
}
