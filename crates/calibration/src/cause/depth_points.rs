//! Depth at points of the board that the images show, under every alternative.

use depthcal_io::{DepthFrame, ImageError};
use depthcal_model::Camera;
use depthcal_statistics::upper_median;
use nalgebra::{Matrix4, Point3, Vector4};

use super::depth_alternative::{DepthAlternative, Quantity, Turn};
use crate::observe::board_region::BoardRegion;
use crate::observe::{CameraFrames, PosedFrame};

/// Points along a side of the rectangle of markers.
const POINTS_PER_SIDE: usize = 14;
/// Share of the points that have to agree: of the depth pixels within a board all but a few holes and rims are the board's.
const AGREEING: f64 = 0.7;
/// Fewest points that say anything.
const FEWEST_POINTS: usize = 100;
/// Iterations of a fit by least absolute deviations.
const ITERATIONS: usize = 15;
/// Ridge of such a fit, as a share of the trace of its normal matrix.
const RIDGE: f64 = 1e-10;

/// A point of the board in the image, and the camera's view of it.
#[derive(Debug, Clone, Copy)]
pub(super) struct BoardPoint {
    /// The pixel, px.
    pub(super) pixel: [f64; 2],
    /// Its place in widths of the image, from the middle.
    pub(super) place: [f64; 2],
    /// Depth by the image, mm.
    pub(super) z_mm: f64,
    /// Distance along the ray per z.
    pub(super) range_per_z: f64,
}

/// A frame's points, and the raw values of depth images there by [`DepthAlternative::FRAMES`] and [`Turn::ALL`], NaN where
/// nothing was measured.
pub(super) struct FramePoints {
    pub(super) points: Vec<BoardPoint>,
    raw: Vec<Vec<Vec<f64>>>,
}

/// How far measured depth is from the boards.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deviation {
    /// Relative deviation that most points do not exceed, where inverse depth has the error of a depth camera that fits best: an
    /// affine function of place and inverse depth, as D. Without that freedom another depth could fit better by chance.
    pub relative: f64,
    /// Relative deviation with no other freedom than the scale.
    pub relative_in_scale: f64,
    /// Measured over expected depth; 1 of a disparity.
    pub scale: f64,
    /// Share of the points with a measurement.
    pub coverage: f64,
    /// Of a disparity d, a and b in 1/z = a + b d, 1/mm.
    pub affine: Option<[f64; 2]>,
}

/// Points over the markers of a frame.
pub(super) fn board_points(capture: &CameraFrames<PosedFrame>, camera: &Camera, frame: &PosedFrame) -> Vec<BoardPoint> {
    let region = BoardRegion::within_markers(&capture.target, &frame.markers);
    let corners = region.hull();
    let range = |axis: usize| {
        let low = corners.iter().map(|c| c[axis]).fold(f64::INFINITY, f64::min);
        let high = corners.iter().map(|c| c[axis]).fold(f64::NEG_INFINITY, f64::max);
        (low, high)
    };
    let [(left, right), (top, bottom)] = [0, 1].map(range);
    let place = |low: f64, high: f64, i: usize| low + (high - low) * (i as f64 + 0.5) / POINTS_PER_SIDE as f64;
    let point = |i: usize| {
        let board = [place(left, right, i % POINTS_PER_SIDE), place(top, bottom, i / POINTS_PER_SIDE)];
        let point_in_camera = frame.camera_from_board * Point3::new(board[0], board[1], 0.0);
        let mm_per_px = point_in_camera.z / camera.pinhole()[0];
        if !region.contains(board, mm_per_px) {
            return None;
        }
        let pixel = camera.project(&point_in_camera.coords)?;
        let is_inside = pixel[0] > -0.5
            && pixel[1] > -0.5
            && pixel[0] < capture.width as f64 - 0.5
            && pixel[1] < capture.height as f64 - 0.5;
        let range_per_z = point_in_camera.coords.norm() / point_in_camera.z;
        let width = capture.width as f64;
        let place = [pixel[0] / width - 0.5, (pixel[1] - 0.5 * capture.height as f64) / width];
        is_inside.then_some(BoardPoint { pixel, place, z_mm: point_in_camera.z, range_per_z })
    };
    (0..POINTS_PER_SIDE * POINTS_PER_SIDE).filter_map(point).collect()
}

impl FramePoints {
    /// The points of frame `number` with the values of the depth images of the frames around it, of which only those of `frames`
    /// are read; `None` where the frame has no depth image.
    ///
    /// # Errors
    ///
    /// [`ImageError`] where an image has become unreadable.
    pub(super) fn of(
        capture: &CameraFrames<PosedFrame>,
        camera: &Camera,
        number: usize,
        frames: &[isize],
        turns: &[Turn],
    ) -> Result<Self, ImageError> {
        let points = board_points(capture, camera, &capture.frames[number]);
        let mut raw = Vec::new();
        for frame in DepthAlternative::FRAMES {
            // Where depth images show the frame before theirs, this frame is shown by the one after it.
            let other = number.checked_add_signed(-frame).and_then(|i| capture.frames.get(i));
            let is_read = frames.contains(&frame);
            let stored = other.filter(|_| is_read).and_then(|frame| frame.depth_image());
            let depth = stored.map(|stored| stored.get()).transpose()?;
            let values = |turn: &Turn| match &depth {
                Some(depth) if turns.contains(turn) => points.iter().map(|p| raw_at(depth, *turn, p.pixel)).collect(),
                _ => vec![f64::NAN; points.len()],
            };
            raw.push(Turn::ALL.iter().map(values).collect());
        }
        Ok(Self { points, raw })
    }

    /// Its points with the raw values under an alternative.
    fn raw(&self, alternative: DepthAlternative) -> impl Iterator<Item = (&BoardPoint, f64)> {
        let frame = DepthAlternative::FRAMES.iter().position(|frame| *frame == alternative.frame);
        let turn = Turn::ALL.iter().position(|turn| *turn == alternative.turn);
        let values = frame.zip(turn).and_then(|(frame, turn)| self.raw.get(frame)?.get(turn));
        self.points.iter().zip(values.into_iter().flatten().copied())
    }
}

/// The raw value of a depth image at the pixel that belongs to one of the image; NaN where there is none.
fn raw_at(depth: &DepthFrame, turn: Turn, pixel: [f64; 2]) -> f64 {
    let pixel = pixel.map(|c| c.round().max(0.0) as usize);
    let place = turn.depth_pixel(pixel, [depth.width, depth.height]);
    place.and_then(|[u, v]| depth.measurement(v * depth.width + u)).unwrap_or(f64::NAN)
}

/// A point with a value: its depth by the image, mm, its place, and the inverse depth that was measured there, or the disparity.
type Measured = (f64, [f64; 2], f64);

/// The deviation of depth under an alternative; `None` where too few points have a measurement.
pub(super) fn deviation(frames: &[FramePoints], unit_mm: f64, alternative: DepthAlternative) -> Option<Deviation> {
    let is_disparity = alternative.quantity == Quantity::Disparity;
    let all = || frames.iter().flat_map(|frame| frame.raw(alternative));
    let measured = |(point, raw): (&BoardPoint, f64)| -> Option<Measured> {
        let value = alternative.quantity.value(raw, point.range_per_z).filter(|value| *value > 0.0)?;
        Some((point.z_mm, point.place, if is_disparity { value } else { 1.0 / (value * unit_mm) }))
    };
    let measured: Vec<Measured> = all().filter_map(measured).collect();
    let coverage = measured.len() as f64 / all().count().max(1) as f64;
    let relative = of_depth_camera(&measured)?;
    if is_disparity {
        let pairs: Vec<(f64, f64)> = measured.iter().map(|(z_mm, _, value)| (*z_mm, *value)).collect();
        let (affine, relative_in_scale) = of_affine(&pairs)?;
        return Some(Deviation { relative, relative_in_scale, scale: 1.0, coverage, affine: Some(affine) });
    }
    let logarithms: Vec<f64> = measured.iter().map(|(z_mm, _, rho)| -(rho * z_mm).ln()).collect();
    let (scale, relative_in_scale) = of_scale(&logarithms)?;
    Some(Deviation { relative, relative_in_scale, scale: scale.exp(), coverage, affine: None })
}

/// The relative deviation of inverse depth from the function of place (x, y) and value v that fits best, a + b x + c y + d v, by
/// least absolute deviations; `None` of few points.
fn of_depth_camera(measured: &[Measured]) -> Option<f64> {
    if measured.len() < FEWEST_POINTS {
        return None;
    }
    let typical = upper_median(&mut measured.iter().map(|(_, _, value)| *value).collect::<Vec<_>>())?;
    let row = |(z_mm, [x, y], value): &Measured| Vector4::new(1.0, *x, *y, value / typical) * *z_mm;
    let mut weights = vec![1.0; measured.len()];
    let mut deviations = Vec::new();
    for _ in 0..ITERATIONS {
        let (mut normal, mut right) = (Matrix4::zeros(), Vector4::zeros());
        for (point, weight) in measured.iter().zip(&weights) {
            let row = row(point);
            normal += *weight * row * row.transpose();
            right += *weight * row;
        }
        // Boards at one distance leave the affine function open.
        normal += Matrix4::identity() * (RIDGE * normal.trace());
        let affine = normal.cholesky()?.solve(&right);
        deviations = measured.iter().map(|point| (row(point).dot(&affine) - 1.0).abs()).collect();
        weights.iter_mut().zip(&deviations).for_each(|(weight, deviation)| *weight = 1.0 / deviation.max(1e-4));
    }
    most(deviations)
}

/// The median of logarithms of measured over expected depth, and the deviation from it that most do not exceed; `None` of few.
pub(super) fn of_scale(logarithms: &[f64]) -> Option<(f64, f64)> {
    if logarithms.len() < FEWEST_POINTS {
        return None;
    }
    let median = upper_median(&mut logarithms.to_vec())?;
    most(logarithms.iter().map(|l| (l - median).abs()).collect()).map(|deviation| (median, deviation))
}

/// The relative deviation of inverse depth from an affine function of the value, by least absolute deviations, and the function.
pub(super) fn of_affine(pairs: &[(f64, f64)]) -> Option<([f64; 2], f64)> {
    if pairs.len() < FEWEST_POINTS {
        return None;
    }
    let scale = upper_median(&mut pairs.iter().map(|(_, value)| *value).collect::<Vec<_>>())?;
    let residual = |[a, b]: [f64; 2], (z_mm, value): &(f64, f64)| (a + b * value / scale) * z_mm - 1.0;
    let mut weights = vec![1.0; pairs.len()];
    let mut affine = [0.0; 2];
    for _ in 0..ITERATIONS {
        // Least squares of (a + b v) z = 1.
        let mut sums = [0.0; 5];
        for ((z, value), weight) in pairs.iter().zip(&weights) {
            let row = [*z, z * value / scale];
            let terms = [row[0] * row[0], row[0] * row[1], row[1] * row[1], row[0], row[1]];
            sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += weight * term);
        }
        let [aa, ab, bb, a, b] = sums;
        let determinant = aa * bb - ab * ab;
        if determinant <= 1e-12 * aa * bb {
            return None;
        }
        affine = [(a * bb - b * ab) / determinant, (b * aa - a * ab) / determinant];
        weights.iter_mut().zip(pairs).for_each(|(weight, pair)| *weight = 1.0 / residual(affine, pair).abs().max(1e-4));
    }
    let deviation = most(pairs.iter().map(|pair| residual(affine, pair).abs()).collect())?;
    Some(([affine[0], affine[1] / scale], deviation))
}

/// The value that most do not exceed.
fn most(mut values: Vec<f64>) -> Option<f64> {
    let place = (AGREEING * values.len() as f64) as usize;
    (place < values.len()).then(|| *values.select_nth_unstable_by(place, f64::total_cmp).1)
}

/// The deviation of depth that is the same everywhere: an alternative that is no better says nothing of the data.
pub(super) fn trivial(frames: &[FramePoints]) -> f64 {
    let logarithms: Vec<f64> = frames.iter().flat_map(|frame| frame.points.iter().map(|p| p.z_mm.ln())).collect();
    of_scale(&logarithms).map_or(0.0, |(_, deviation)| deviation)
}
