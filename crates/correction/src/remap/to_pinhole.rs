//! The map from a camera's images to those of an ideal pinhole camera.

use depthcal_model::{Camera, Context};
use rayon::prelude::*;

use super::means::{Cell, Means, WINDOW, weights};
use super::nearest::{Nearest, Run, runs};
use super::segments::{BORDER, SEGMENT, Segment, segments, windows};
use crate::conventions::{TYPICAL_RHO, pixel};
use crate::error::CorrectorError;
use crate::simd::dispatch;

/// Maps a camera's images to those of an ideal pinhole camera, without lens distortion, in the same place. Pixels whose
/// source lies outside the image become 0. All images are row-major, with one value per pixel of the calibrated
/// resolution.
#[derive(Debug, Clone)]
pub struct Remap {
    width: usize,
    height: usize,
    /// Nearest source pixels; those of a row are the runs from `rows[row]` to `rows[row + 1]`.
    runs: Vec<Run>,
    rows: Vec<u32>,
    /// Four source pixels for interpolation: segments of [`SEGMENT`] pixels, and a cell per pixel.
    segments: Vec<Segment>,
    cells: Vec<Cell>,
}

/// A pixel value that can be interpolated: u8, u16 or [u8; 3].
pub trait Texel: Copy + Default + Send + Sync + Means {}

impl Texel for u8 {}
impl Texel for u16 {}
impl Texel for [u8; 3] {}

/// Share by which the depths of four neighbouring pixels on the same surface may differ.
const SAME_SURFACE: f32 = 0.03;

impl Remap {
    /// The map to a pinhole camera with the size, focal lengths and principal point of the camera itself.
    pub fn undistort(camera: &Camera) -> Self {
        Self::to_pinhole(camera, camera.pinhole())
    }

    /// The map to a pinhole camera of the same size, given fx, fy, cx, cy, skew in px.
    pub fn to_pinhole(camera: &Camera, pinhole: [f64; 5]) -> Self {
        let (width, height) = (camera.width, camera.height);
        let source = |index: usize| source(camera, pinhole, pixel(index, width));
        let sources: Vec<[f64; 2]> = (0..width * height).into_par_iter().map(source).collect();
        let (runs, rows) = runs(&sources, width, height);
        let (segments, cells) = segments(&sources, width, height);
        Self { width, height, runs, rows, segments, cells }
    }

    /// Takes the nearest source pixel: for depth, labels and masks.
    ///
    /// # Errors
    ///
    /// [`CorrectorError::Length`] where an image does not have one value per pixel of the camera.
    pub fn nearest<T: Copy + Default + Send + Sync>(&self, image: &[T], out: &mut [T]) -> Result<(), CorrectorError> {
        self.check(image, out)?;
        self.for_rows(out, |row, out| self.nearest_row(row, image, out));
        Ok(())
    }

    /// Interpolates linearly between four source pixels, with weights that are multiples of 1/256: for images. The
    /// nearest pixel at the border of the image, where the four are not complete.
    ///
    /// # Errors
    ///
    /// [`CorrectorError::Length`] where an image does not have one value per pixel of the camera.
    pub fn linear<T: Texel>(&self, image: &[T], out: &mut [T]) -> Result<(), CorrectorError> {
        self.check(image, out)?;
        self.for_segments(image, out, T::means, |four, weights, _| T::mean(four, weights));
        Ok(())
    }

    /// Interpolates depth between four source pixels on the same surface: all four valid, and less than 3 % apart. The
    /// mean is that of inverse depth, which is affine over the image of a plane. Elsewhere, takes the nearest pixel.
    ///
    /// # Errors
    ///
    /// [`CorrectorError::Length`] where an image does not have one value per pixel of the camera.
    pub fn depth(&self, depth: &[u16], out: &mut [u16]) -> Result<(), CorrectorError> {
        self.check(depth, out)?;
        // Maps [upper left, upper right, lower left, lower right], their weights and the nearest pixel to the result.
        let mean = |four: [u16; 4], weights: [u32; 4], nearest: u16| {
            let [a, b, c, d] = four.map(f32::from);
            let least = a.min(b).min(c.min(d));
            let most = a.max(b).max(c.max(d));
            // 65536 / Σ (w / z), with a common denominator.
            let w = weights.map(|w| w as f32);
            let (ab, cd) = (a * b, c * d);
            let mean = 65536.0 * ab * cd / ((w[0] * b + w[1] * a) * cd + (w[2] * d + w[3] * c) * ab);
            let one_surface = (least > 0.0) & (most - least < SAME_SURFACE * least);
            if one_surface { (mean + 0.5) as u16 } else { nearest }
        };
        let means = |windows: [&[u16; WINDOW]; 4], cells: &[Cell], out: &mut [u16]| {
            for (out, cell) in out.iter_mut().zip(cells) {
                let four = windows.map(|window| window[usize::from(cell.offset)]);
                let nearest = four[usize::from(cell.right >= 128) + 2 * usize::from(cell.lower >= 128)];
                *out = mean(four, weights(*cell), nearest);
            }
        };
        self.for_segments(depth, out, means, mean);
        Ok(())
    }

    fn check<T>(&self, image: &[T], out: &[T]) -> Result<(), CorrectorError> {
        let expected = self.width * self.height;
        let wrong = [("the image", image.len()), ("the output", out.len())].into_iter().find(|(_, n)| *n != expected);
        wrong.map_or(Ok(()), |(what, length)| Err(CorrectorError::Length { what, found: length, expected }))
    }

    /// Calls `work` for every row of the output, in bands on the threads of the current rayon pool.
    fn for_rows<T: Send>(&self, out: &mut [T], work: impl Fn(usize, &mut [T]) + Sync) {
        let threads = rayon::current_num_threads();
        let rows = |first: usize, out: &mut [T]| {
            out.chunks_exact_mut(self.width).enumerate().for_each(|(row, out)| work(first + row, out));
        };
        if threads == 1 {
            return rows(0, out);
        }
        let band = self.height.div_ceil(2 * threads).max(16);
        out.par_chunks_mut(band * self.width).enumerate().for_each(|(k, out)| rows(k * band, out));
    }

    fn nearest_row<T: Copy + Default>(&self, row: usize, image: &[T], out: &mut [T]) {
        let runs = &self.runs[self.rows[row] as usize..self.rows[row + 1] as usize];
        dispatch(Nearest { runs, image, out });
    }

    /// Interpolates an image. Segments that are whole are computed by `means`, from their windows and cells. In other
    /// segments, pixels with four source pixels are computed by `mean`, from these, their weights and the nearest
    /// pixel; the others become the nearest pixel.
    fn for_segments<T: Copy + Default + Send + Sync>(
        &self,
        image: &[T],
        out: &mut [T],
        means: impl Fn([&[T; WINDOW]; 4], &[Cell], &mut [T]) + Sync,
        mean: impl Fn([T; 4], [u32; 4], T) -> T + Sync,
    ) {
        let per_row = self.width.div_ceil(SEGMENT);
        self.for_rows(out, |row, out| {
            let cells = &self.cells[row * self.width..(row + 1) * self.width];
            let segments = &self.segments[row * per_row..(row + 1) * per_row];
            if segments.iter().any(|segment| !segment.whole) {
                self.nearest_row(row, image, out);
            }
            for ((segment, cells), out) in segments.iter().zip(cells.chunks(SEGMENT)).zip(out.chunks_mut(SEGMENT)) {
                let base = segment.base as usize;
                if let Some(windows) = segment.whole.then(|| windows(image, base, self.width)).flatten() {
                    means(windows, cells, out);
                    continue;
                }
                for (out, cell) in out.iter_mut().zip(cells).filter(|(_, cell)| **cell != BORDER) {
                    let first = base + usize::from(cell.offset);
                    let corners = [first, first + 1, first + self.width, first + self.width + 1];
                    *out = mean(corners.map(|i| image[i]), weights(*cell), *out);
                }
            }
        });
    }
}

/// The pixel of the camera's depth image that shows what the given pinhole camera shows at a pixel; NaN where there is
/// none.
fn source(camera: &Camera, [fx, fy, cx, cy, skew]: [f64; 5], [u, v]: [f64; 2]) -> [f64; 2] {
    let y = (v - cy) / fy;
    let x = (u - cx - skew * y) / fx;
    let z = 1.0 / TYPICAL_RHO;
    let Some(image) = camera.project(&[x * z, y * z, z].into()) else { return [f64::NAN; 2] };
    // Pieces at the hook `pixel` map image to depth image. The camera offers only their inverse, so this is a
    // fixed-point iteration.
    let mut pixel = image;
    for _ in 0..4 {
        let seen = camera.image_pixel(&Context { pixel, ..Context::default() });
        pixel = [pixel[0] + image[0] - seen[0], pixel[1] + image[1] - seen[1]];
    }
    pixel
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::block;

    fn camera(width: usize, height: usize) -> Camera {
        let lens = block("brown_conrady", &[-0.1468, 0.0463, 0.0012, -0.0007, -0.0756]);
        let f = 0.745 * width as f64;
        Camera::new(width, height, [f, f, 0.49 * width as f64, 0.5 * height as f64, 0.0], vec![lens])
    }

    /// A large image has windows, a small one goes pixel by pixel; a longer focal length sees less, a shorter one
    /// beyond.
    fn cases() -> impl Iterator<Item = (Camera, Remap, [f64; 5])> {
        [(640, 480), (100, 70)].into_iter().flat_map(|(w, h)| {
            let camera = camera(w, h);
            [1.0, 0.7].map(|zoom| {
                let [fx, fy, cx, cy, skew] = camera.pinhole();
                let pinhole = [fx * zoom, fy * zoom, cx, cy, skew];
                (camera.clone(), Remap::to_pinhole(&camera, pinhole), pinhole)
            })
        })
    }

    #[test]
    fn nearest_is_the_source_rounded() {
        for (camera, remap, pinhole) in cases() {
            let (w, n) = (camera.width, camera.width * camera.height);
            let image: Vec<u32> = (0..n as u32).map(|i| i + 1).collect();
            let mut out = vec![7; n];
            remap.nearest(&image, &mut out).unwrap();
            for (i, value) in out.iter().enumerate() {
                let [u, v] = source(&camera, pinhole, pixel(i, w)).map(f64::round);
                let inside = u >= 0.0 && v >= 0.0 && u < w as f64 && v < camera.height as f64;
                let expected = if inside { (v as usize * w + u as usize) as u32 + 1 } else { 0 };
                assert_eq!(*value, expected, "pixel {i}");
            }
        }
    }

    /// Where an output pixel comes from, by the definition of the map.
    enum Origin {
        /// Upper left, upper right, lower left, lower right source pixel, and the fractions of a pixel to the right and
        /// down.
        Between([usize; 4], [f64; 2]),
        /// The nearest pixel, at the border of the image.
        Border(usize),
        Outside,
    }

    fn origin(camera: &Camera, pinhole: [f64; 5], index: usize) -> Origin {
        let (w, h) = (camera.width, camera.height);
        let [u, v] = source(camera, pinhole, pixel(index, w));
        let (right, bottom) = ((w - 1) as f64, (h - 1) as f64);
        if (0.0..=right).contains(&u) && (0.0..=bottom).contains(&v) {
            let (column, row) = (u.floor().min(right - 1.0), v.floor().min(bottom - 1.0));
            let first = row as usize * w + column as usize;
            return Origin::Between([first, first + 1, first + w, first + w + 1], [u - column, v - row]);
        }
        if (-0.5..right + 0.5).contains(&u) && (-0.5..bottom + 0.5).contains(&v) {
            return Origin::Border(v.round().max(0.0) as usize * w + u.round().max(0.0) as usize);
        }
        Origin::Outside
    }

    /// The mean of a function of four values, mapped back by the same function. Weights are multiples of 1/256 and
    /// below 1.
    fn mean(four: [f64; 4], fractions: [f64; 2], map: impl Fn(f64) -> f64) -> f64 {
        let [right, lower] = fractions.map(|fraction| (256.0 * fraction).round().min(255.0) / 256.0);
        let [a, b, c, d] = four.map(&map);
        map((a + right * (b - a)) * (1.0 - lower) + (c + right * (d - c)) * lower)
    }

    #[test]
    fn output_pixels_show_the_rays_of_their_sources() {
        for (camera, _, [fx, fy, cx, cy, _]) in cases() {
            let mut seen = 0;
            for index in (0..camera.width * camera.height).step_by(13) {
                let [u, v] = pixel(index, camera.width);
                let skew = 2.5;
                let pixel = source(&camera, [fx, fy, cx, cy, skew], [u, v]);
                let Ok([x, y]) = camera.ray(pixel, TYPICAL_RHO) else { continue };
                seen += 1;
                assert!((fx * x + skew * y + cx - u).hypot(fy * y + cy - v) < 1e-6, "pixel {index}");
            }
            assert!(seen > camera.width * camera.height / 20, "{seen}");
        }
    }

    #[test]
    fn linear_is_the_mean_of_four_pixels_with_their_weights() {
        for (camera, remap, pinhole) in cases() {
            let n = camera.width * camera.height;
            let value = |i: usize, channel: usize| ((i * i * 31 + (17 * channel + 7) * i) % 251 + 1) as u8;
            let rgb: Vec<[u8; 3]> = (0..n).map(|i| [0, 1, 2].map(|channel| value(i, channel))).collect();
            let bytes: Vec<u8> = rgb.iter().map(|rgb| rgb[0]).collect();
            let wide: Vec<u16> = bytes.iter().map(|byte| u16::from(*byte) * 257).collect();
            let (mut out_rgb, mut out_bytes, mut out_wide) = (vec![[7; 3]; n], vec![7; n], vec![7; n]);
            remap.linear(&rgb, &mut out_rgb).unwrap();
            remap.linear(&bytes, &mut out_bytes).unwrap();
            remap.linear(&wide, &mut out_wide).unwrap();
            let mut between = 0;
            for i in 0..n {
                match origin(&camera, pinhole, i) {
                    Origin::Between(four, fractions) => {
                        between += 1;
                        for channel in 0..3 {
                            let four = four.map(|k| f64::from(rgb[k][channel]));
                            let expected = mean(four, fractions, |v| v);
                            assert!((f64::from(out_rgb[i][channel]) - expected).abs() <= 0.500_001, "pixel {i}");
                        }
                        let expected = mean(four.map(|k| f64::from(wide[k])), fractions, |v| v);
                        assert!((f64::from(out_wide[i]) - expected).abs() <= 0.500_001, "pixel {i}");
                    }
                    Origin::Border(nearest) => assert_eq!((out_rgb[i], out_wide[i]), (rgb[nearest], wide[nearest])),
                    Origin::Outside => assert_eq!((out_rgb[i], out_wide[i]), ([0; 3], 0), "pixel {i}"),
                }
                assert_eq!(out_bytes[i], out_rgb[i][0], "pixel {i}");
            }
            // A focal length of 0.7 shows the whole image on half of the output.
            assert!(between > n * 2 / 5, "{between} of {n}");
        }
    }

    #[test]
    fn depth_is_interpolated_on_surfaces_at_every_depth_and_is_the_nearest_pixel_elsewhere() {
        for (camera, remap, pinhole) in cases() {
            let (w, n) = (camera.width, camera.width * camera.height);
            // A surface from 65535 to 701 with 2.6 % across every four pixels, again and again; one with 70 across
            // every four pixels, which is more than 3 % up to a depth of 2333; noise.
            let surface = |i: usize| (65_535.0 * (-0.013 * ((i % w + i / w) % 350) as f64).exp()) as u16;
            let steep = |i: usize| (1000 + 40 * (i % w) + 30 * (i / w)) as u16;
            let noise = |i: usize| if i.is_multiple_of(5) { 0 } else { (i * 40_503 % 65_536) as u16 };
            let (mut interpolated, mut taken) = (0, 0);
            for image in
                [(0..n).map(surface).collect::<Vec<_>>(), (0..n).map(steep).collect(), (0..n).map(noise).collect()]
            {
                let mut out = vec![7; n];
                remap.depth(&image, &mut out).unwrap();
                for (i, value) in out.iter().enumerate() {
                    let (four, fractions) = match origin(&camera, pinhole, i) {
                        Origin::Between(four, fractions) => (four.map(|k| image[k]), fractions),
                        Origin::Border(nearest) => {
                            assert_eq!(*value, image[nearest], "pixel {i}");
                            continue;
                        }
                        Origin::Outside => {
                            assert_eq!(*value, 0, "pixel {i}");
                            continue;
                        }
                    };
                    let (least, most) = (four.into_iter().min().unwrap_or(0), four.into_iter().max().unwrap_or(0));
                    if least > 0 && f64::from(most - least) < 0.03 * f64::from(least) {
                        interpolated += 1;
                        let expected = mean(four.map(f64::from), fractions, |z| 1.0 / z);
                        // Half a step by rounding, and the roundings of f32.
                        let error = (f64::from(*value) - expected).abs();
                        assert!(error <= 0.5 + 1e-6 * expected, "pixel {i}: {four:?} become {value}, not {expected}");
                    } else {
                        taken += 1;
                        // Fractions are rounded to 1/256, so that in the middle between two pixels either is near.
                        let near = |coordinate: f64, fraction: f64| (coordinate - fraction).abs() <= 0.5 + 1.0 / 256.0;
                        let is_near =
                            |k: usize| near((k % 2) as f64, fractions[0]) && near((k / 2) as f64, fractions[1]);
                        let mut nearest = (0..4).filter(|k| is_near(*k));
                        assert!(nearest.any(|k| four[k] == *value), "pixel {i}: {four:?} become {value}");
                    }
                }
            }
            assert!(interpolated > n * 2 / 5 && taken > n * 2 / 5, "{interpolated} and {taken} of {n}");
        }
    }

    #[test]
    fn depth_is_not_mixed_across_an_edge_or_with_nothing() {
        let camera = camera(640, 480);
        let remap = Remap::undistort(&camera);
        let value = |i: usize| [1000, 2000, 0][(i % 640 / 16 + i / 640 / 16) % 3];
        let image: Vec<u16> = (0..640 * 480).map(value).collect();
        let mut out = vec![7; 640 * 480];
        remap.depth(&image, &mut out).unwrap();
        assert!(out.iter().all(|z| [0, 1000, 2000].contains(z)));
        let mut nearest = vec![7; 640 * 480];
        remap.nearest(&image, &mut nearest).unwrap();
        let same = out.iter().zip(&nearest).filter(|(a, b)| a == b).count();
        // Weights of 1/256 may round to the other neighbour in the very middle.
        assert!(same > 640 * 480 * 98 / 100, "{same}");
        assert!(remap.nearest(&image[1..], &mut out).is_err() && remap.depth(&image, &mut out[1..]).is_err());
    }
}
