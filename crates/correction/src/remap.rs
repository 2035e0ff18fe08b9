//! Undistorted images and depth: what an ideal pinhole camera in the same place would show.
//!
//! An output pixel has a ray by the pinhole alone; pinhole and lens say where the camera saw that ray. Depth is z, which is
//! the same seen from anywhere on the ray, so that only its place changes.
//!
//! - [`Remap::nearest`] takes the nearest pixel: for depth, labels, masks. Along a row the source moves on by one pixel most
//!   of the time, so the map is kept as runs that are copied, not as an index per pixel.
//! - [`Remap::linear`] interpolates between four pixels, with weights of 1/256: for images.
//! - [`Remap::depth`] interpolates depth where the four pixels are on one surface, and takes the nearest pixel elsewhere.

mod means;

use depthcal_model::{Camera, Context};
use rayon::prelude::*;

use super::simd::{Isa, Kernel, dispatch};
use super::{CorrectorError, pixel, probe};
use means::{Cell, WINDOW, weights};

/// Maps a camera's images to those of a pinhole camera without lens. Pixels whose source lies outside the image become 0.
#[derive(Debug, Clone)]
pub struct Remap {
    width: usize,
    height: usize,
    /// Runs of a row lie from `rows[row]` to `rows[row + 1]`.
    runs: Vec<Run>,
    rows: Vec<u32>,
    segments: Vec<Segment>,
    cells: Vec<Cell>,
}

/// Neighbouring pixels of an output row whose sources are neighbours too.
#[derive(Debug, Clone, Copy)]
struct Run {
    /// Index of the first source pixel; [`OUTSIDE`] where there is none.
    source: u32,
    length: u32,
}

const OUTSIDE: u32 = u32::MAX;

/// Output pixels that share a window of sources.
const SEGMENT: usize = 64;

#[derive(Debug, Clone, Copy)]
struct Segment {
    /// First source pixel of the window.
    base: u32,
    /// Whether all its pixels have a source, and the window lies in the image with a row to spare.
    whole: bool,
}

/// A value that can be interpolated between four: u8, u16, [u8; 3].
pub trait Texel: Copy + Default + Send + Sync + means::Means {}

impl Texel for u8 {}
impl Texel for u16 {}
impl Texel for [u8; 3] {}

/// Neighbours whose depth differs by more than this share are on different surfaces.
const SAME_SURFACE: f32 = 0.03;

impl Remap {
    /// To a pinhole camera of the same size with the camera's own pinhole.
    pub fn undistort(camera: &Camera) -> Self {
        Self::to_pinhole(camera, camera.pinhole())
    }

    /// To a pinhole camera of the same size with fx, fy, cx, cy, skew in px.
    pub fn to_pinhole(camera: &Camera, pinhole: [f64; 5]) -> Self {
        let (width, height) = (camera.width, camera.height);
        let source = |index: usize| source(camera, pinhole, pixel(index, width));
        let sources: Vec<[f64; 2]> = (0..width * height).into_par_iter().map(source).collect();
        let inside = |at: f64, size: usize| at >= -0.5 && at < size as f64 - 0.5;
        let nearest = |[u, v]: [f64; 2]| {
            let found = inside(u, width) && inside(v, height);
            let index = || (v.round().max(0.0) as usize * width + u.round().max(0.0) as usize) as u32;
            if found { index() } else { OUTSIDE }
        };
        let (mut runs, mut rows) = (Vec::<Run>::new(), vec![0]);
        for row in sources.chunks(width) {
            let first = runs.len();
            for source in row.iter().map(|at| nearest(*at)) {
                match runs[first..].last_mut() {
                    Some(run) if run.source != OUTSIDE && source == run.source + run.length => run.length += 1,
                    Some(run) if run.source == OUTSIDE && source == OUTSIDE => run.length += 1,
                    _ => runs.push(Run { source, length: 1 }),
                }
            }
            rows.push(runs.len() as u32);
        }
        let (segments, cells) = segments(&sources, width, height);
        Self { width, height, runs, rows, segments, cells }
    }

    /// The nearest source pixel of every output pixel.
    ///
    /// # Errors
    ///
    /// [`CorrectorError::Length`] where an image does not have one value per pixel.
    pub fn nearest<T: Copy + Default + Send + Sync>(&self, image: &[T], out: &mut [T]) -> Result<(), CorrectorError> {
        self.check(image, out)?;
        self.for_rows(out, |row, out| self.nearest_row(row, image, out));
        Ok(())
    }

    /// An image between its pixels.
    ///
    /// # Errors
    ///
    /// [`CorrectorError::Length`] where an image does not have one value per pixel.
    pub fn linear<T: Texel>(&self, image: &[T], out: &mut [T]) -> Result<(), CorrectorError> {
        self.check(image, out)?;
        self.for_segments(image, out, T::means, |four, weights, _| T::mean(four, weights));
        Ok(())
    }

    /// A depth image between its pixels, where they are on one surface: all four valid, and apart by less than 3 %. The
    /// mean is that of inverse depth, which is affine over a plane's image. The nearest pixel elsewhere.
    ///
    /// # Errors
    ///
    /// [`CorrectorError::Length`] where an image does not have one value per pixel.
    pub fn depth(&self, depth: &[u16], out: &mut [u16]) -> Result<(), CorrectorError> {
        self.check(depth, out)?;
        let mean = |four: [u16; 4], weights: [u32; 4], nearest: u16| {
            let [a, b, c, d] = four.map(f32::from);
            let least = a.min(b).min(c.min(d));
            let most = a.max(b).max(c.max(d));
            // 1 / Σ (w / z) over one denominator.
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
        wrong.map_or(Ok(()), |(what, found)| Err(CorrectorError::Length { what, found, expected }))
    }

    /// Rows of the output, in bands on the threads of the pool.
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

    /// Calls `means` with the windows and cells of segments, and `mean` with the four source pixels, their weights and the
    /// nearest pixel of what remains; where one of the four is missing the nearest pixel it is.
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

/// A row of nearest pixels.
struct Nearest<'a, T> {
    runs: &'a [Run],
    image: &'a [T],
    out: &'a mut [T],
}

impl<T: Copy + Default> Kernel for Nearest<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self, _: I) {
        /// What is copied at a time, beyond the end of a run too: the next one overwrites that.
        const BLOCK: usize = 16;
        let Self { runs, image, out } = self;
        let mut at = 0;
        for run in runs {
            let (source, length) = (run.source as usize, run.length as usize);
            if run.source == OUTSIDE {
                out[at..at + length].fill(T::default());
            } else {
                let padded = length.next_multiple_of(BLOCK);
                match (image.get(source..source + padded), out.get_mut(at..at + padded)) {
                    (Some(image), Some(out)) => {
                        let (from, to) = (image.as_chunks::<BLOCK>().0, out.as_chunks_mut::<BLOCK>().0);
                        to.iter_mut().zip(from).for_each(|(to, from)| *to = *from);
                    }
                    _ => out[at..at + length].copy_from_slice(&image[source..source + length]),
                }
            }
            at += length;
        }
    }
}

/// A pixel without four sources, in a segment that is not whole.
const BORDER: Cell = Cell { offset: u16::MAX, right: u8::MAX, lower: u8::MAX };

/// The windows of the upper left, upper right, lower left and lower right source pixels.
#[inline(always)]
fn windows<T>(image: &[T], base: usize, width: usize) -> Option<[&[T; WINDOW]; 4]> {
    let window = |first: usize| image.get(first..first + WINDOW)?.first_chunk();
    Some([window(base)?, window(base + 1)?, window(base + width)?, window(base + width + 1)?])
}

/// Pixel of the camera's (depth) image that shows what a pinhole camera shows at `pixel`; NaN where none does.
fn source(camera: &Camera, [fx, fy, cx, cy, skew]: [f64; 5], [u, v]: [f64; 2]) -> [f64; 2] {
    let y = (v - cy) / fy;
    let x = (u - cx - skew * y) / fx;
    let z = 1.0 / probe::TYPICAL_RHO;
    let Some(image) = camera.project(&[x * z, y * z, z].into()) else { return [f64::NAN; 2] };
    // The pixel pieces lead from image to depth image, and the camera has their inverse alone.
    let mut pixel = image;
    for _ in 0..4 {
        let seen = camera.image_pixel(&Context { pixel, ..Context::default() });
        pixel = [pixel[0] + image[0] - seen[0], pixel[1] + image[1] - seen[1]];
    }
    pixel
}

fn segments(sources: &[[f64; 2]], width: usize, height: usize) -> (Vec<Segment>, Vec<Cell>) {
    let pixels = width * height;
    let spare = WINDOW + width + 1;
    // Upper left source pixel and the fractions, where all four sources are in the image.
    let corner = |[u, v]: [f64; 2]| {
        let inside = u >= 0.0 && v >= 0.0 && u <= width as f64 - 1.0 && v <= height as f64 - 1.0;
        let (column, row) = ((u as usize).min(width.max(2) - 2), (v as usize).min(height.max(2) - 2));
        let enough = width > 1 && height > 1;
        (inside && enough).then(|| (row * width + column, [u - column as f64, v - row as f64]))
    };
    let (mut segments, mut cells) = (Vec::new(), Vec::with_capacity(pixels));
    for part in sources.chunks(width).flat_map(|row| row.chunks(SEGMENT)) {
        let corners: Vec<_> = part.iter().map(|at| corner(*at)).collect();
        let least = corners.iter().flatten().map(|(index, _)| *index).min().unwrap_or(0);
        let base = least.min(pixels.saturating_sub(spare));
        let of_corner = |corner: &Option<(usize, [f64; 2])>| {
            let (index, fractions) = (*corner)?;
            let offset = u16::try_from(index - base).ok()?;
            let [right, lower] = fractions.map(|f| (f * 256.0).round().min(255.0) as u8);
            Some(Cell { offset, right, lower })
        };
        let found: Vec<Option<Cell>> = corners.iter().map(of_corner).collect();
        segments.push(Segment { base: base as u32, whole: pixels >= spare && found.iter().all(Option::is_some) });
        cells.extend(found.iter().map(|cell| cell.unwrap_or(BORDER)));
    }
    (segments, cells)
}

#[cfg(test)]
mod tests {
    use depthcal_model::Register;

    use super::*;

    fn camera(width: usize, height: usize) -> Camera {
        let mut lens = Register::builtin().block("brown_conrady", None).unwrap();
        lens.theta = vec![-0.1468, 0.0463, 0.0012, -0.0007, -0.0756];
        let f = 0.745 * width as f64;
        Camera::new(width, height, [f, f, 0.49 * width as f64, 0.5 * height as f64, 0.0], vec![lens])
    }

    /// A large image has windows, a small one goes pixel by pixel; a longer focal length sees less, a shorter one beyond.
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
            for (i, found) in out.iter().enumerate() {
                let [u, v] = source(&camera, pinhole, pixel(i, w)).map(f64::round);
                let inside = u >= 0.0 && v >= 0.0 && u < w as f64 && v < camera.height as f64;
                let expected = if inside { (v as usize * w + u as usize) as u32 + 1 } else { 0 };
                assert_eq!(*found, expected, "pixel {i}");
            }
        }
    }

    #[test]
    fn linear_reproduces_what_is_affine_in_the_pixels() {
        for (camera, remap, pinhole) in cases() {
            let (w, h) = (camera.width, camera.height);
            let image: Vec<u16> = (0..w * h).map(|i| (1000 + 40 * (i % w) + 30 * (i / w)) as u16).collect();
            let (mut between, mut depth) = (vec![0; w * h], vec![0; w * h]);
            remap.linear(&image, &mut between).unwrap();
            remap.depth(&image, &mut depth).unwrap();
            for i in 0..w * h {
                let [u, v] = source(&camera, pinhole, pixel(i, w));
                if u >= 0.0 && v >= 0.0 && u <= w as f64 - 1.0 && v <= h as f64 - 1.0 {
                    let expected = 1000.0 + 40.0 * u + 30.0 * v;
                    // Half a step of rounding and half a 256th of a pixel in the weights, a whole one at the last pixel.
                    assert!((f64::from(between[i]) - expected).abs() < 0.5 + 70.0 / 256.0, "pixel {i}");
                    // The mean of inverse depth lies lower by the square of the difference over eight depths.
                    assert!((f64::from(depth[i]) - expected).abs() < 0.5 + 70.0 / 256.0 + 1.0 || expected < 2400.0);
                }
            }
            let rgb: Vec<[u8; 3]> = image.iter().map(|v| [(v >> 8) as u8, 9, 255]).collect();
            let mut out = vec![[0; 3]; w * h];
            remap.linear(&rgb, &mut out).unwrap();
            assert!(out.iter().all(|c| *c == [0; 3] || (c[1] == 9 && c[2] == 255)));
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
