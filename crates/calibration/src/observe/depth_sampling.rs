//! Selection of the depth pixels for the joint adjustment: on a grid no finer than the correlation length of their noise, so
//! that their errors are independent.

use depthcal_io::ImageError;
use depthcal_model::{Camera, Modulation, Target};
use depthcal_statistics::Thinning;
use nalgebra::{Isometry3, Matrix3, Vector3};
use rayon::prelude::*;

use super::board_pixels::{BoardPixel, BoardPixels, board_pixels};
use super::board_plane::BoardPlane;
use super::board_region::BoardRegion;
use super::camera_frames::CameraFrames;
use super::frame_light::keep_light;
use super::noise::clipped_sigma;
use super::outliers::{remove_outliers, remove_outliers_and_rim};
use super::pixel_rays::PixelRays;
use super::stages::{DepthPixel, DepthSample, MeasuredDepth, OpenFrame, PosedFrame, SampledFrame};

/// Longest distance at which correlation is measured, px.
pub(crate) const LONGEST_PX: usize = 8;
/// Share of the variance at the longest distance at which pixels count as uncorrelated.
const SILL: f64 = 0.9;
/// Largest step of a sampling grid, px.
const COARSEST_PX: usize = 64;
/// Frames from which the correlation length is measured, about.
const FRAMES: usize = 8;

/// Samples the depth of every frame within its markers, but no outliers. Of a depth image, the pixels on a grid whose step is the
/// measured correlation length of the noise, or larger where the frame would have more than `most_per_frame` samples; of single
/// pixels, all whose ray meets the board. With `light`, samples have the light of their frames at these modulation frequencies.
/// Returns the frames and, where there are depth images, the correlation length, px.
///
/// # Errors
///
/// [`ImageError`] where a depth image has become unreadable.
pub fn sample_depth(
    mut capture: CameraFrames<PosedFrame>,
    camera: &Camera,
    most_per_frame: usize,
    light: Option<Modulation>,
) -> Result<(CameraFrames<SampledFrame>, Option<usize>), ImageError> {
    let unit_mm = capture.depth_unit_mm.unwrap_or(1.0);
    let rays = PixelRays::new(camera, &capture.target).with_light(light);
    keep_light(&mut capture, &rays)?;
    let has_images = capture.frames.iter().any(|f| f.depth_image().is_some());
    let correlation_length_px = if has_images {
        let stride = capture.frames.len().div_ceil(FRAMES).max(1);
        let some = capture.frames.par_iter().step_by(stride);
        let pixels: Result<Vec<Vec<BoardPixel>>, ImageError> =
            some.map(|f| Ok(measured_on_board(f, &f.open()?, (&capture.target, &rays, unit_mm)).pixels)).collect();
        Some(correlation_length(&pixels?))
    } else {
        None
    };
    let sample = |posed: &PosedFrame| match &posed.depth {
        MeasuredDepth::None => Ok(Vec::new()),
        MeasuredDepth::Pixels(pixels) => Ok(seeded(pixels, &rays, &posed.camera_from_board)),
        MeasuredDepth::Image(_) => {
            let frame = posed.open()?;
            let BoardPixels { pixels, covariates } =
                measured_on_board(posed, &frame, (&capture.target, &rays, unit_mm));
            let pixels = thinned(pixels, correlation_length_px.unwrap_or(1), most_per_frame);
            let sample = |p: &BoardPixel| DepthSample {
                context: covariates.complete(p.number, p.pixel),
                depth_mm: p.depth_mm,
                board_seed: p.board,
            };
            Ok(pixels.iter().map(sample).collect())
        }
    };
    let frames: Result<Vec<Vec<DepthSample>>, ImageError> = capture.frames.par_iter().map(sample).collect();
    let frames = frames?;
    let mut sampled = capture.with_frames(Vec::new());
    let posed = capture.frames.into_iter();
    sampled.frames =
        posed.zip(frames).map(|(posed, samples)| SampledFrame { posed, samples: samples.into() }).collect();
    Ok((sampled, correlation_length_px))
}

/// The pixels of a frame on its board, without outliers.
fn measured_on_board<'a>(
    posed: &PosedFrame,
    frame: &'a OpenFrame<'a>,
    (target, rays, unit_mm): (&Target, &PixelRays<'_>, f64),
) -> BoardPixels<'a> {
    let region = BoardRegion::within_markers(target, &posed.markers);
    let mut on_board = board_pixels(frame, unit_mm, rays, &region, &posed.camera_from_board, Thinning::ALL);
    remove_outliers_and_rim(&mut on_board.pixels);
    on_board
}

/// Share of the pixels that a grid should have, below which other offsets of the grid are looked at.
const SPARSE: f64 = 0.5;

/// Pixels on a grid with the step `step`, or a larger one where these would be more than `most`. Where depth images leave columns
/// or rows out, the grid begins in those that they have.
fn thinned(mut pixels: Vec<BoardPixel>, mut step: usize, most: usize) -> Vec<BoardPixel> {
    loop {
        let (offset, count) = offset_of_grid(&pixels, step);
        if count <= most || step >= COARSEST_PX {
            pixels.retain(|p| offset_in_grid(p, step) == offset);
            return pixels;
        }
        let ratio = (count as f64 / most as f64).sqrt();
        step = (step + 1).max((step as f64 * ratio) as usize);
    }
}

/// Column and row of a pixel within its cell of a grid.
fn offset_in_grid(pixel: &BoardPixel, step: usize) -> [usize; 2] {
    pixel.pixel.map(|c| c as usize % step)
}

/// Where a grid begins, and how many pixels are on it: at zero, or where most are if zero is without its share of them.
fn offset_of_grid(pixels: &[BoardPixel], step: usize) -> ([usize; 2], usize) {
    let at_zero = pixels.iter().filter(|p| offset_in_grid(p, step) == [0; 2]).count();
    if at_zero as f64 >= SPARSE * pixels.len() as f64 / (step * step) as f64 {
        return ([0; 2], at_zero);
    }
    let mut counts = vec![0; step * step];
    for pixel in pixels {
        let [column, row] = offset_in_grid(pixel, step);
        counts[row * step + column] += 1;
    }
    let most = (0..counts.len()).rev().max_by_key(|i| counts[*i]).unwrap_or(0);
    ([most % step, most / step], counts[most])
}

/// Single pixels with the board points that their rays meet; outliers and pixels whose ray meets no board are dropped.
fn seeded(pixels: &[DepthPixel], rays: &PixelRays<'_>, camera_from_board: &Isometry3<f64>) -> Vec<DepthSample> {
    let plane = BoardPlane::new(camera_from_board);
    let pixel = |(number, p): (u32, &DepthPixel)| {
        let ray = rays.camera().ray(p.context.pixel, 1.0 / p.depth_mm).ok()?;
        let board_depth_mm = plane.depth(ray)?;
        let point = plane.to_board(ray, board_depth_mm);
        let (pixel, depth_mm, board) = (p.context.pixel, p.depth_mm, [point.x, point.y]);
        let cos_incidence = plane.cos_incidence(ray);
        Some(BoardPixel { number, pixel, depth_mm, board_depth_mm, board, ray, cos_incidence })
    };
    let mut on_board: Vec<BoardPixel> = (0..).zip(pixels).filter_map(pixel).collect();
    remove_outliers(&mut on_board);
    let context = |p: &BoardPixel| pixels[p.number as usize].context;
    let sample = |p: &BoardPixel| DepthSample { context: context(p), depth_mm: p.depth_mm, board_seed: p.board };
    on_board.iter().map(sample).collect()
}

/// Correlation length of the noise, px, from the structure function ½ E[(e(x + h) − e(x))²] of the deviations e from a plane in
/// every frame: the distance h at which it reaches the share [`SILL`] of its value at [`LONGEST_PX`]. Systematic errors that
/// vary slowly over the image hardly contribute to differences of near pixels.
fn correlation_length(frames: &[Vec<BoardPixel>]) -> usize {
    let mut sums = [(0.0_f64, 0_usize); LONGEST_PX + 1];
    for pixels in frames {
        let deviations = plane_deviations(pixels);
        let scale = 6.0 * clipped_sigma(&deviations);
        let key = |p: &BoardPixel| p.pixel.map(|c| c as usize);
        let inliers = || pixels.iter().zip(&deviations).filter(|(_, e)| e.abs() <= scale);
        let size = pixels.iter().map(key).fold([0; 2], |s, p| [s[0].max(p[0] + 1), s[1].max(p[1] + 1)]);
        // Pixels that neighbours are looked for beyond the last column and row are there, and empty.
        let columns = size[0] + LONGEST_PX;
        let mut field = vec![f64::NAN; columns * (size[1] + LONGEST_PX)];
        for (p, e) in inliers() {
            let [u, v] = key(p);
            field[v * columns + u] = e / scale;
        }
        for (p, e) in inliers() {
            let [u, v] = key(p);
            for (h, sum) in sums.iter_mut().enumerate().skip(1) {
                for other in [field[v * columns + u + h], field[(v + h) * columns + u]] {
                    if !other.is_nan() {
                        sum.0 += (e / scale - other).powi(2);
                        sum.1 += 1;
                    }
                }
            }
        }
    }
    let value = |h: usize| if sums[h].1 > 0 { sums[h].0 / sums[h].1 as f64 } else { f64::NAN };
    distance_of_the_sill(value)
}

/// Distance, px, at which a structure function reaches the share [`SILL`] of its value at [`LONGEST_PX`].
pub(crate) fn distance_of_the_sill(structure: impl Fn(usize) -> f64) -> usize {
    let sill = SILL * structure(LONGEST_PX);
    (1..=LONGEST_PX).find(|h| !(structure(*h) < sill)).unwrap_or(LONGEST_PX)
}

/// Deviations of inverse depth from its least-squares affine function of the ray, 1/mm.
pub(crate) fn plane_deviations(pixels: &[BoardPixel]) -> Vec<f64> {
    let (mut normal, mut rhs) = (Matrix3::zeros(), Vector3::zeros());
    for p in pixels {
        let row = Vector3::new(p.ray[0], p.ray[1], 1.0);
        normal += row * row.transpose();
        rhs += row / p.depth_mm;
    }
    let plane = normal.cholesky().map_or_else(Vector3::zeros, |c| c.solve(&rhs));
    pixels.iter().map(|p| 1.0 / p.depth_mm - plane.dot(&Vector3::new(p.ray[0], p.ray[1], 1.0))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};

    /// A depth image whose even rows are empty has as many samples as one of half the height.
    #[test]
    fn rows_without_depth_are_no_part_of_the_grid() {
        let pixel = |u: u32, v: u32| BoardPixel {
            number: 0,
            pixel: [f64::from(u), f64::from(v)],
            depth_mm: 1000.0,
            board_depth_mm: 1000.0,
            board: [0.0; 2],
            ray: [0.0; 2],
            cos_incidence: 1.0,
        };
        let rows = |is_row: fn(u32) -> bool| -> Vec<BoardPixel> {
            (0..80).filter(|v| is_row(*v)).flat_map(|v| (0..100).map(move |u| pixel(u, v))).collect()
        };
        assert_eq!(thinned(rows(|_| true), 2, 10_000).len(), 50 * 40);
        assert_eq!(thinned(rows(|v| v % 2 == 1), 2, 10_000).len(), 50 * 40);
        assert!((400..=1000).contains(&thinned(rows(|v| v % 2 == 1), 1, 1000).len()));
    }

    /// White noise is uncorrelated at one pixel; noise averaged over a 3×3 window at three.
    #[test]
    fn correlation_of_white_and_of_averaged_noise() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let unit = Normal::new(0.0, 2e-6).unwrap();
        let n = 80;
        let white: Vec<f64> = (0..n * n).map(|_| unit.sample(&mut rng)).collect();
        let averaged = |u: usize, v: usize| {
            (0..3).flat_map(|i| (0..3).map(move |j| (i, j))).map(|(i, j)| white[(v + i) * n + u + j]).sum::<f64>() / 3.0
        };
        let field = |value: &dyn Fn(usize, usize) -> f64| -> Vec<BoardPixel> {
            let pixels = (0..n - 3).flat_map(|v| (0..n - 3).map(move |u| (u, v)));
            pixels
                .map(|(u, v)| BoardPixel {
                    number: 0,
                    pixel: [u as f64, v as f64],
                    depth_mm: 1.0 / (1e-3 + 1e-7 * u as f64 + value(u, v)),
                    board_depth_mm: 1000.0,
                    board: [0.0; 2],
                    ray: [u as f64 / 500.0, v as f64 / 500.0],
                    cos_incidence: 1.0,
                })
                .collect()
        };
        assert_eq!(correlation_length(&[field(&|u, v| white[v * n + u])]), 1);
        assert_eq!(correlation_length(&[field(&averaged)]), 3);
    }
}
